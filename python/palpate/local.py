"""Training, simulation and recognition in this process, without a server.

The numbers are those of the server's method `surface`, bit for bit, for the same readings and
seed and for versions trained with `sva=False`. What needs a server: stored sessions, several
robots, calibrations and passports of sensors, warnings, the other methods.
"""

from __future__ import annotations

import os
import sys
import warnings
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from palpate import _native
from palpate._native import Catalogue, Mesh, Sensor
from palpate.belief import Belief
from palpate.pose import FloatArray, PoseLike, poses_array
from palpate.readings import Readings

UNITS = {"m": 1.0, "mm": 1e-3, "cm": 1e-2, "in": 25.4e-3}
"""Lengths of the units of mesh files, metres."""

DEFAULT_SENSOR = "digitacts-6x6"


def load_mesh(path: str | os.PathLike[str], *, unit: str | None = None) -> Mesh:
    """The mesh of a file (STL, OBJ, PLY, OFF, GLB, 3MF).

    The unit is mandatory for all but GLB and 3MF, which record it. Warns of what is remarkable.
    """
    if unit is not None and unit not in UNITS:
        raise ValueError(f"unit: came {unit!r}, expected one of {', '.join(UNITS)}")
    file = Path(path)
    try:
        return Mesh.from_bytes(file.read_bytes(), file.suffix, UNITS[unit] if unit else None)
    except ValueError as error:
        if str(error).startswith("unit: "):
            raise
        detail = str(error).removeprefix("content: ").removeprefix("format: ")
        raise ValueError(f"path: {file}: {detail}") from error


def make_mesh(vertices: npt.ArrayLike, faces: npt.ArrayLike) -> Mesh:
    """The mesh of vertices (n × 3, metres) and faces (m × 3 indices)."""
    indices = np.asarray(faces)
    if not np.issubdtype(indices.dtype, np.integer):
        raise ValueError(f"faces: are of type {indices.dtype}, expected integers")
    points = np.ascontiguousarray(vertices, dtype=np.float64)
    for name, array in (("vertices", points), ("faces", indices)):
        if array.ndim != 2:
            raise ValueError(f"{name}: have shape {array.shape}, expected n × 3")
    return Mesh(points, np.ascontiguousarray(indices, dtype=np.int64))


def press(
    mesh: Mesh,
    sensor: Sensor,
    object_from_sensor: Sequence[PoseLike] | npt.ArrayLike,
    *,
    seed: int = 1,
) -> FloatArray:
    """The images (n × taxels, Pa) of a sensor pressed into a mesh at poses.

    A sensor's +z points at the object; its covering's free surface is at z = 0, so the surface
    must lie there at z < 0 for contact. `seed` determines the noise.
    """
    return _native.press(mesh, sensor, poses_array(object_from_sensor), seed=checked_seed(seed))


def touch(mesh: Mesh, sensor: Sensor, n: int, *, seed: int = 1) -> Readings:
    """`n` touches anywhere on a mesh that rest in contact, in the mesh's frame."""
    poses, images = _native.touch(mesh, sensor, n, seed=checked_seed(seed))
    return Readings(poses, images)


def train(
    objects: Mapping[str, Mesh | Readings],
    *,
    sensor: Sensor | None = None,
    touches: int | None = None,
    surface_touches: int | None = None,
    seed: int = 1,
    progress: bool | Callable[[int, int], None] = False,
) -> Catalogue:
    """Trains the surfaces of objects, as a server's training with `sva=False` does.

    An object is trained from simulated touches of its mesh, or from readings at rest in one
    frame. `touches` and `surface_touches` are `readings_per_object` and
    `surface_readings_per_object` of the API (default: 1000 and 2400, or as many as `touches`).
    `sensor` takes both (default: `digitacts-6x6`). All randomness comes from `seed`; the object at
    index i uses seed + i. Runs on all cores; Ctrl-C stops it. `progress` prints the touches of
    meshes so far to the standard error, or is called with them and their number.
    """
    used = Sensor.preset(DEFAULT_SENSOR) if sensor is None else sensor
    sources: list[tuple[str, Mesh | _native.Readings]] = []
    for name, source in objects.items():
        if isinstance(source, Readings):
            try:
                sources.append((name, native(used, source)))
            except ValueError as error:
                raise ValueError(f'objects["{name}"]: {error}') from error
        else:
            sources.append((name, source))
    tell = print_progress if progress is True else progress or None
    trained = Catalogue.train(
        sources,
        sensor=used,
        touches=touches,
        surface_touches=surface_touches,
        seed=checked_seed(seed),
        progress=tell,
    )
    if progress is True:
        print(file=sys.stderr)
    if len(sources) == 1:
        warnings.warn(
            "the catalogue has one object: nothing can be told apart, and probabilities are not "
            "calibrated",
            stacklevel=2,
        )
    return trained


def print_progress(done: int, total: int) -> None:
    """Shows the touches of a training so far on one line of the standard error."""
    print(f"\r{done} of {total} touches", end="", file=sys.stderr, flush=True)


def checked_seed(seed: int) -> int:
    """A seed, which is no negative number and has at most 64 bits."""
    if not 0 <= seed < 2**64:
        raise ValueError(f"seed: came {seed}, expected 0 to 2⁶⁴ - 1")
    return seed


def save(catalogue: Catalogue, path: str | os.PathLike[str]) -> None:
    """Writes a catalogue to a file, which `load` of the same version of palpate reads."""
    Path(path).write_bytes(catalogue.to_bytes())


def load(path: str | os.PathLike[str]) -> Catalogue:
    """The catalogue of a file that `save` wrote."""
    try:
        return Catalogue.from_bytes(Path(path).read_bytes())
    except ValueError as error:
        raise ValueError(f"path: {os.fspath(path)}: {error}") from error


def sensor_of(arguments: dict[str, Any]) -> Sensor:
    """The sensor of these arguments of `Sensor.preset` or `Sensor.grid`; pickles use it."""
    return Sensor.preset(**arguments) if "name" in arguments else Sensor.grid(**arguments)


class Recognition:
    """A session in this process: touches in, beliefs out, by the method `surface`."""

    def __init__(
        self,
        catalogue: Catalogue,
        *,
        unknown_prior: float | None = None,
        prior: Mapping[str, float] | None = None,
        object_moves: tuple[float, float] | None = None,
    ) -> None:
        """Begins with the prior.

        `unknown_prior` is the prior probability of "none of these" (default 0.05); `prior` the
        probabilities of objects, all others share the rest; `object_moves` the deviations
        (metres, radians) of an object that shifts at every touch.
        """
        weights = None if prior is None else _weights(catalogue.names, prior)
        self._native = _native.Recognition(
            catalogue, unknown_prior=unknown_prior, prior=weights, object_moves=object_moves
        )

    def touch(
        self,
        sensor: Sensor,
        image: npt.ArrayLike,
        pose: PoseLike,
        *,
        approach_m: float = 0.0,
        object_moved: tuple[float, float] | None = None,
    ) -> Belief:
        """Adds one press and returns the belief after it; arguments as of `TouchSession.touch`."""
        if object_moved is not None:
            self._native.announce_move(*object_moved)
        reading = Readings.of([pose], np.asarray(image, dtype=np.float64).reshape(1, -1))
        self._native.add(native(sensor, reading, np.array([approach_m])))
        return self.belief()

    def add(self, sensor: Sensor, readings: Readings) -> Belief:
        """Adds readings in their order, each as one press, and returns the belief after them."""
        self._native.add(native(sensor, readings))
        return self.belief()

    def __repr__(self) -> str:
        return f"Recognition({self.belief()!r})"

    def belief(self, *, poses: int = 5, risk: float | None = None) -> Belief:
        """The belief with at most `poses` poses; `risk` adds the advice on stopping."""
        return Belief.from_wire(self._native.belief(poses=poses, risk=risk))


def native(
    sensor: Sensor, readings: Readings, approach: FloatArray | None = None
) -> _native.Readings:
    """The readings, checked against their sensor."""
    poses = np.ascontiguousarray(readings.poses, dtype=np.float64)
    images = np.ascontiguousarray(readings.images, dtype=np.float64)
    return _native.Readings(sensor, poses, images, approach)


def _weights(names: list[str], prior: Mapping[str, float]) -> list[float]:
    """The weights of all objects."""
    unknown = prior.keys() - set(names)
    if unknown:
        known = ", ".join(names)
        raise ValueError(f"prior: names {', '.join(sorted(unknown))}, expected some of {known}")
    stated = sum(prior.values())
    if any(not 0 <= weight <= 1 for weight in prior.values()) or stated > 1 + 1e-9:
        raise ValueError(f"prior: sums to {stated}, expected probabilities that sum to at most 1")
    rest = len(names) - len(prior)
    share = max(0.0, 1 - stated) / rest if rest else 0.0
    return [prior.get(name, share) for name in names]


__all__ = [
    "Belief",
    "Catalogue",
    "Mesh",
    "Readings",
    "Recognition",
    "Sensor",
    "load",
    "load_mesh",
    "make_mesh",
    "press",
    "save",
    "touch",
    "train",
]
