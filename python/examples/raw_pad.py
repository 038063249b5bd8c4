"""Writes what a 4 × 4 array and an arm would send while they press a mesh: a stream for a driver.

    python raw_pad.py mug.stl --presses 12 >stream.txt

The object lies somewhere in the robot's base frame. Taxels have offsets, which drift, unequal
gains and noise; the arm approaches, presses, waits and lifts. The format is that of pad_driver.py.
"""

from __future__ import annotations

import argparse

import numpy as np
from pad_driver import COLS, FLANGE_FROM_SENSOR, PA_PER_COUNT, ROWS

from palpate import Pose, local

FRAME_MS = 20
BASE_FROM_OBJECT = Pose.of(([0.0, 0.0, 0.38268343, 0.92387953], [0.42, -0.10, 0.20]))
AIR = 0.010
"""Distance from which the arm approaches, metres."""
COUNTS_MAX = 4095

PAD = local.Sensor.grid(
    ROWS,
    COLS,
    pitch=0.004,
    taxel_width=0.0036,
    covering_thickness=0.003,
    saturation=100e3,
    quantisation=PA_PER_COUNT,
    noise=50.0,
    knowledge="measured",
)


def distances() -> list[float]:
    """Distances of the sensor from where it comes to rest, one a frame of a press."""
    air, pressing, rest = [AIR] * 20, np.linspace(AIR, 0.0, 30), [0.0] * 15
    return [*air, *pressing, *rest, *pressing[::-3]]


def main() -> None:
    """Writes the stream."""
    parser = argparse.ArgumentParser(description="Simulates a raw stream")
    parser.add_argument("mesh", help="STL, OBJ, PLY or OFF, in millimetres")
    parser.add_argument("--presses", type=int, default=12)
    parser.add_argument("--seed", type=int, default=5)
    options = parser.parse_args()

    mesh = local.load_mesh(options.mesh, unit="mm")
    rng = np.random.default_rng(options.seed)
    offsets, gains = rng.uniform(250, 350, ROWS * COLS), rng.normal(1.0, 0.05, ROWS * COLS)
    time_ms = 10_000
    for rest in local.touch(mesh, PAD, options.presses, seed=options.seed).poses:
        path = [Pose.of(rest) @ Pose.of((np.eye(3), [0, 0, -one])) for one in distances()]
        images = local.press(mesh, PAD, path, seed=options.seed + time_ms)
        for object_from_sensor, image in zip(path, images, strict=True):
            offsets += 0.02
            base_from_flange = BASE_FROM_OBJECT @ object_from_sensor @ FLANGE_FROM_SENSOR.inverse()
            x, y, z, qx, qy, qz, qw = base_from_flange.numbers
            flange = [1e3 * x, 1e3 * y, 1e3 * z, qw, qx, qy, qz]
            print(f"arm,{time_ms - 3}," + ",".join(f"{one:.5f}" for one in flange))
            pressures = (gains * image).reshape(ROWS, COLS).T.ravel()
            counts = offsets + pressures / PA_PER_COUNT + rng.normal(0.0, 1.5, ROWS * COLS)
            shown = np.clip(np.round(counts), 0, COUNTS_MAX).astype(int)
            print(f"pad,{time_ms}," + ",".join(map(str, shown)))
            time_ms += FRAME_MS


if __name__ == "__main__":
    main()
