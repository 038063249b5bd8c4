"""The example of a driver: presses are found in a raw stream, and none is lost or counted twice."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest
from conftest import Server

import palpate
from palpate import Pose

sys.path.insert(0, str(Path(__file__).resolve().parents[1] / "examples"))

import pad_driver

OFFSETS = np.linspace(250.0, 350.0, 16)
SHAPE = np.zeros((4, 4))
SHAPE[0] = [400.0, 200.0, 0.0, 0.0]
"""A press on the first row of the image, counts above the zero."""


def stream(depths: list[float], *, drift: float = 0.0, x_mm: float = 400.0) -> list[str]:
    """The lines of both devices for a press that is as deep as `depths` say, 1 for all of it."""
    lines = []
    for index, depth in enumerate(depths):
        time = 1000 + 20 * index
        # The device sends columns first.
        counts = OFFSETS + drift * index + depth * SHAPE.T.ravel()
        lines.append(f"arm,{time - 3},{x_mm},-100,250,0,1,0,0")
        lines.append(f"pad,{time}," + ",".join(f"{round(one)}" for one in counts))
    return lines


AIR, RAMP, REST = [0.0] * 20, [0.2, 0.4, 0.6, 0.8], [1.0] * 12
PRESS = [*AIR, *RAMP, *REST, *RAMP[::-1]]


def test_a_settled_press_is_found_once_in_pascal_row_by_row() -> None:
    (found,) = pad_driver.presses_of(stream(PRESS))
    image = found.image.reshape(4, 4)
    assert np.allclose(image, pad_driver.PA_PER_COUNT * SHAPE, atol=25.0)


def test_each_press_is_tared_anew() -> None:
    found = list(pad_driver.presses_of(stream(3 * PRESS, drift=0.5)))
    assert len(found) == 3
    for press in found:
        # In the 9 frames from the zero to the rest the taxels drift by some counts.
        assert np.abs(press.image - pad_driver.PA_PER_COUNT * SHAPE.ravel()).max() < 400.0


def test_a_pose_is_in_metres_and_of_the_sensor() -> None:
    (found,) = pad_driver.presses_of(stream(PRESS))
    base_from_flange = Pose.of(([1.0, 0.0, 0.0, 0.0], [0.4, -0.1, 0.25]))
    expected = base_from_flange @ pad_driver.FLANGE_FROM_SENSOR
    assert np.allclose(found.pose.matrix, expected.matrix, atol=1e-6)
    assert np.allclose(found.pose.position, [0.4, -0.112, 0.165], atol=1e-6)


def test_what_does_not_rest_is_no_press(capsys: pytest.CaptureFixture[str]) -> None:
    swinging = [*AIR, *([0.5, 1.0] * 8), *AIR]
    assert not list(pad_driver.presses_of(stream(swinging)))
    assert "released before it settled" in capsys.readouterr().err


def test_a_frame_without_a_pose_of_its_time_does_not_count() -> None:
    lines = [line for line in stream(PRESS) if line.startswith("pad")]
    assert not list(pad_driver.presses_of(["arm,10,400,-100,250,0,1,0,0", *lines]))


def test_broken_lines_are_left_out(capsys: pytest.CaptureFixture[str]) -> None:
    lines = stream(PRESS)
    lines.insert(7, "pad,1060,311,298")
    assert len(list(pad_driver.presses_of(lines))) == 1
    assert "a line is broken" in capsys.readouterr().err


def test_presses_wait_for_the_server_and_count_once(
    own_server: Server, tmp_path: Path, taught: dict[str, palpate.Readings]
) -> None:
    presses = list(pad_driver.presses_of(stream(3 * PRESS)))
    file = tmp_path / "presses.jsonl"
    retry = palpate.RetryPolicy(attempts_max=1)
    with palpate.Client("http://127.0.0.1:9", retry=retry) as away:
        outbox = pad_driver.Outbox(file, "none", "xela-uskin-4x4", "arm-1")
        for press in presses:
            outbox.add(press)
        assert outbox.send(away) is None
    with palpate.Client(own_server.address) as client:
        for name, readings in taught.items():
            client.create_object(name)
            client.add_training_readings(name, "digitacts-6x6", readings)
        client.train(sva=False, surface=True, seed=1)
        session = client.create_session().id
        for _ in range(2):
            # A driver that was started again.
            outbox = pad_driver.Outbox(file, session, "xela-uskin-4x4", "arm-1")
            belief = outbox.send(client)
            assert belief is not None
            assert belief.n_readings == 3
