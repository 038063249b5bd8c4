"""A driver for a flat 4 × 4 array on an arm: lines of counts and arm poses in, readings out.

    python pad_driver.py stream.txt --server http://127.0.0.1:7411

The stream (a file, or `-` for standard input) has lines of both devices, with milliseconds of one
clock, as many arrays and controllers write them:

    pad,12040,311,298,…       16 counts of 12 bits, column by column from the connector
    arm,12038,412.1,-98.0,231.5,0.0,1.0,0.0,0.0    flange in base: mm, quaternion w, x, y, z

docs/drivers.md explains each step.
"""

from __future__ import annotations

import argparse
import fileinput
import json
import sys
from collections import deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import numpy.typing as npt

from palpate import (
    Belief,
    BrokenError,
    BusyError,
    Client,
    Pose,
    Readings,
    TimedOutError,
    UnreachableError,
)

Counts = npt.NDArray[np.float64]

ROWS = COLS = 4
PA_PER_COUNT = 25.0
"""100 kPa over 4,000 counts, from the data sheet."""
FLANGE_FROM_SENSOR = Pose.of(([0.0, 0.0, 0.70710678, 0.70710678], [0.0, 0.012, 0.085]))
"""The tool centre, from the drawing of the mount: the array is 85 mm before the flange, 12 mm
beside its axis and turned by a quarter."""

TARE_FRAMES = 10
"""Frames in air whose mean is the zero."""
GUARD_FRAMES = 3
"""Frames before a contact that may belong to it: they are left out of the zero."""
CONTACT_COUNTS = 40.0
"""Counts above the zero that are a contact, on any taxel: about five deviations of the noise."""
SETTLED_FRAMES = 5
"""Frames over which a settled press is averaged."""
SETTLED_SHARE = 0.03
"""Largest change within these frames, as a share of the largest value (at least
`SETTLED_COUNTS`)."""
SETTLED_COUNTS = 12.0
STILL = 0.0002
"""Largest motion of the sensor within these frames, metres."""
POSE_AGE_MS = 20.0
"""Largest difference between the times of a frame and of its pose."""


@dataclass(frozen=True)
class Press:
    """A settled press."""

    time_ms: float
    image: Counts
    """Pascal, row by row in the sensor frame."""
    pose: Pose
    """`base_from_sensor`."""


class Arm:
    """The newest poses of the flange."""

    def __init__(self) -> None:
        self._poses: deque[tuple[float, Pose]] = deque(maxlen=100)

    def add(self, time_ms: float, numbers: list[float]) -> None:
        """Takes a pose of the controller: millimetres, and w first."""
        x, y, z, w, qx, qy, qz = numbers
        base_from_flange = Pose.of(([qx, qy, qz, w], [x / 1e3, y / 1e3, z / 1e3]))
        self._poses.append((time_ms, base_from_flange))

    def sensor_at(self, time_ms: float) -> Pose | None:
        """`base_from_sensor` at a time; None if no pose is that recent."""
        nearest = min(self._poses, key=lambda one: abs(one[0] - time_ms), default=None)
        if nearest is None or abs(nearest[0] - time_ms) > POSE_AGE_MS:
            return None
        return nearest[1] @ FLANGE_FROM_SENSOR


class Presses:
    """Finds settled presses in a stream of frames; each press is found once."""

    def __init__(self) -> None:
        self._air: deque[Counts] = deque(maxlen=TARE_FRAMES + GUARD_FRAMES)
        self._held: deque[tuple[float, Counts, Pose]] = deque(maxlen=SETTLED_FRAMES)
        self._in_contact = self._is_sent = False

    def add(self, time_ms: float, counts: Counts, pose: Pose | None) -> Press | None:
        """Takes a frame; returns the press that has settled with it."""
        tare = list(self._air)[:TARE_FRAMES]
        if len(tare) < TARE_FRAMES:
            self._air.append(counts)
            return None
        values = counts - np.mean(tare, axis=0)
        threshold = CONTACT_COUNTS / 2 if self._in_contact else CONTACT_COUNTS
        if values.max() < threshold:
            if self._in_contact and not self._is_sent:
                print("a press was released before it settled", file=sys.stderr)
            if self._in_contact:
                # The covering creeps back: the zero is taken anew after a contact.
                self._air.clear()
                self._held.clear()
            self._in_contact = self._is_sent = False
            self._air.append(counts)
            return None
        self._in_contact = True
        if pose is None:
            self._held.clear()
            return None
        self._held.append((time_ms, values, pose))
        if self._is_sent or not self._is_settled():
            return None
        self._is_sent = True
        mean = np.mean([held for _, held, _ in self._held], axis=0)
        return Press(time_ms, image_of(mean), self._held[-1][2])

    def _is_settled(self) -> bool:
        if len(self._held) < SETTLED_FRAMES:
            return False
        values = np.array([held for _, held, _ in self._held])
        places = np.array([pose.position for _, _, pose in self._held])
        allowed = max(SETTLED_COUNTS, SETTLED_SHARE * values.max())
        return bool(
            np.ptp(values, axis=0).max() <= allowed and np.ptp(places, axis=0).max() <= STILL
        )


def image_of(values: Counts) -> Counts:
    """Counts above the zero, column by column, as pascal row by row."""
    return (PA_PER_COUNT * values).reshape(COLS, ROWS).T.ravel()


def presses_of(lines: Iterable[str]) -> Iterator[Press]:
    """The settled presses of a stream."""
    arm, presses = Arm(), Presses()
    for line in lines:
        kind, time, *rest = line.strip().split(",")
        numbers = [float(one) for one in rest]
        if kind == "arm":
            arm.add(float(time), numbers)
        elif kind == "pad" and len(numbers) == ROWS * COLS:
            found = presses.add(float(time), np.array(numbers), arm.sensor_at(float(time)))
            if found is not None:
                yield found
        else:
            print(f"a line is broken: {line.strip()[:40]!r}", file=sys.stderr)


class Outbox:
    """Presses in a file, sent in order. The number of a line is the number of its reading.

    What was written is never lost: after a failure, or a restart, all presses that may be
    missing are sent again, and the server counts each number once.
    """

    def __init__(self, file: Path, session: str, sensor: str, robot: str) -> None:
        self._file, self._session, self._sensor, self._robot = file, session, sensor, robot
        file.touch()
        self._n_sent = 0

    def add(self, press: Press) -> None:
        """Writes a press."""
        line = {"pose": press.pose.numbers.tolist(), "image": press.image.tolist()}
        with self._file.open("a") as file:
            file.write(json.dumps(line) + "\n")

    def send(self, client: Client) -> Belief | None:
        """Sends what is left; the belief after it, or None if the server is away."""
        lines = [json.loads(line) for line in self._file.read_text().splitlines()]
        left = lines[self._n_sent :]
        if not left:
            return None
        poses = np.array([line["pose"] for line in left])
        readings = Readings.of(poses, [line["image"] for line in left])
        try:
            added = client.add_readings(
                self._session, self._sensor, readings, robot=self._robot, first_seq=self._n_sent
            )
        except (UnreachableError, TimedOutError, BrokenError, BusyError) as error:
            print(f"kept {len(left)}: {error}", file=sys.stderr)
            return None
        self._n_sent = len(lines)
        for warning in added.warnings:
            print(f"warning {warning.code}: {warning.detail}", file=sys.stderr)
        return added.belief


def main() -> None:
    """Drives one session."""
    parser = argparse.ArgumentParser(description="Posts the presses of a stream to a session")
    parser.add_argument("stream", help="a file, or - for standard input")
    parser.add_argument("--server", default=None, help="default: PALPATE_SERVER")
    parser.add_argument("--sensor", default="pad")
    parser.add_argument("--robot", default="arm-1")
    parser.add_argument("--outbox", type=Path, default=Path("presses.jsonl"))
    parser.add_argument("--session", help="go on with this session; default: a new one")
    parser.add_argument("--only-write", action="store_true", help="write presses and send nothing")
    options = parser.parse_args()

    if options.only_write:
        outbox = Outbox(options.outbox, "", options.sensor, options.robot)
        with fileinput.input([options.stream]) as lines:
            for press in presses_of(lines):
                outbox.add(press)
        return
    with Client(options.server) as client, fileinput.input([options.stream]) as lines:
        session = options.session or client.create_session(frame_id="base", risk=0.05).id
        print("session", session)
        outbox = Outbox(options.outbox, session, options.sensor, options.robot)
        for press in presses_of(lines):
            outbox.add(press)
            belief = outbox.send(client)
            if belief is not None:
                found = "none of these" if belief.best is None else belief.best
                print(f"{belief.n_readings:3} presses: {found}, unknown {belief.unknown:.2f}")
        belief = outbox.send(client) or client.belief(session)
        print("the answer:", belief.best or "none of these")


if __name__ == "__main__":
    main()
