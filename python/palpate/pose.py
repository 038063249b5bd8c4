"""Poses: where a sensor or an object is.

A pose `a_from_b` maps coordinates of frame b into frame a. It is a position in metres and a
quaternion in the order x, y, z, w.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Union, overload

import numpy as np
import numpy.typing as npt

from palpate.options import PoseDocument
from palpate.values import Value

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

FloatArray = npt.NDArray[np.float64]

ROTATION_TOLERANCE = 1e-2
"""Largest deviation of a matrix from a rotation, as of the server's quaternions."""


@dataclass(frozen=True, eq=False)
class Pose(Value):
    """A pose. Build it with `Pose.of` from a 4 × 4 matrix or a rotation and a translation.

    Two poses are equal if all their numbers are; `isclose` allows for rounding.
    """

    __array_ufunc__ = None
    """Lets `array @ pose` be an error instead of an array of objects."""

    position: FloatArray
    """x, y, z, metres."""
    orientation: FloatArray
    """Quaternion x, y, z, w."""

    def __post_init__(self) -> None:
        """Refuses an orientation that is no rotation, such as four zeros."""
        _check_unit(self.orientation)

    @classmethod
    def of(cls, given: PoseLike) -> Pose:
        """The pose of a 4 × 4 matrix, seven numbers (x, y, z, qx, qy, qz, qw), or a pair.

        A pair is a rotation and a translation: a scipy `Rotation`, a 3 × 3 matrix or a
        quaternion (x, y, z, w), and three metres.
        """
        if isinstance(given, Pose):
            return given
        if hasattr(given, "as_matrix") and not isinstance(given, tuple):
            # Such as scipy's RigidTransform; a Rotation alone has no position.
            given = np.asarray(given.as_matrix(), dtype=np.float64)
        if isinstance(given, tuple) and len(given) == 2:
            turn, position = given
            return cls(_numbers("translation", position, (3,)), _quaternion(turn))
        numbers = np.asarray(given, dtype=np.float64)
        if numbers.shape == (7,):
            return cls(numbers[:3].copy(), numbers[3:].copy())
        if numbers.shape == (4, 4):
            if not np.array_equal(numbers[3], [0.0, 0.0, 0.0, 1.0]):
                raise ValueError(f"pose: last row is {numbers[3]}, expected 0, 0, 0, 1")
            return cls(numbers[:3, 3].copy(), _quaternion(numbers[:3, :3]))
        raise ValueError(
            f"pose: has shape {numbers.shape}, expected 4 × 4, seven numbers, or a pair of "
            "rotation and translation"
        )

    @classmethod
    def from_wire(cls, document: dict[str, Any] | PoseDocument) -> Pose:
        """The pose of an answer."""
        position = np.array(document["position"], dtype=np.float64)
        return cls(position, np.array(document["orientation"], dtype=np.float64))

    def to_wire(self) -> PoseDocument:
        """The pose in a request."""
        return {"position": self.position.tolist(), "orientation": self.orientation.tolist()}

    @property
    def numbers(self) -> FloatArray:
        """The seven numbers x, y, z, qx, qy, qz, qw."""
        return np.concatenate([self.position, self.orientation])

    @property
    def matrix(self) -> FloatArray:
        """The pose as a 4 × 4 matrix."""
        x, y, z, w = self.orientation / np.linalg.norm(self.orientation)
        matrix = np.eye(4)
        matrix[:3, :3] = [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
        matrix[:3, 3] = self.position
        return matrix

    @property
    def rotation(self) -> Rotation:
        """The orientation as a `Rotation`; needs scipy."""
        from scipy.spatial.transform import Rotation

        return Rotation.from_quat(self.orientation)

    @overload
    def __matmul__(self, other: Pose) -> Pose: ...
    @overload
    def __matmul__(self, other: npt.ArrayLike) -> FloatArray: ...
    def __matmul__(self, other: Pose | npt.ArrayLike) -> Pose | FloatArray:
        """The product: `a_from_b @ b_from_c` is `a_from_c`; with points, `apply`."""
        if isinstance(other, Pose):
            return Pose.of(self.matrix @ other.matrix)
        return self.apply(other)

    def apply(self, points: npt.ArrayLike) -> FloatArray:
        """The points (3, or n × 3, metres) in the frame to which the pose leads."""
        given = np.asarray(points, dtype=np.float64)
        if given.shape[-1:] != (3,) or given.ndim > 2:
            raise ValueError(f"points: have shape {given.shape}, expected 3 or n × 3")
        moved: FloatArray = given @ self.matrix[:3, :3].T + self.position
        return moved

    def isclose(self, other: PoseLike, *, position: float = 1e-9, angle: float = 1e-9) -> bool:
        """Whether the other pose is at most `position` metres and `angle` radians away."""
        there = Pose.of(other)
        ours, theirs = (one.orientation / np.linalg.norm(one.orientation) for one in (self, there))
        apart = min(np.linalg.norm(ours - theirs), np.linalg.norm(ours + theirs))
        turned = 4 * np.arcsin(min(1.0, float(apart) / 2))
        return bool(np.linalg.norm(self.position - there.position) <= position and turned <= angle)

    def __array__(self, dtype: Any = None, copy: bool | None = None) -> FloatArray:
        """The 4 × 4 matrix."""
        return self.matrix.astype(dtype or np.float64)

    def inverse(self) -> Pose:
        """The inverse: `b_from_a` of `a_from_b`."""
        return Pose.of(_inverse(self.matrix))


PoseLike = Union[Pose, npt.ArrayLike, "tuple[Any, npt.ArrayLike]"]
"""What `Pose.of` accepts."""


def poses_array(given: Sequence[PoseLike] | npt.ArrayLike) -> FloatArray:
    """Poses as n × 7 numbers: from such an array, n × 4 × 4 matrices, or a list of poses."""
    if isinstance(given, np.ndarray):
        if given.ndim == 2 and given.shape[1] == 7:
            return np.ascontiguousarray(given, dtype=np.float64)
        if given.ndim != 3:
            raise ValueError(f"poses: have shape {given.shape}, expected n × 7 or n × 4 × 4")
    rows = []
    for index, one in enumerate(given):  # type: ignore[arg-type]
        try:
            rows.append(Pose.of(one).numbers)
        except ValueError as error:
            raise ValueError(f"poses[{index}]: {error}") from error
    return np.array(rows, dtype=np.float64).reshape(len(rows), 7)


def _inverse(matrix: FloatArray) -> FloatArray:
    inverse = np.eye(4)
    inverse[:3, :3] = matrix[:3, :3].T
    inverse[:3, 3] = -matrix[:3, :3].T @ matrix[:3, 3]
    return inverse


def _numbers(argument: str, given: npt.ArrayLike, shape: tuple[int, ...]) -> FloatArray:
    numbers = np.array(given, dtype=np.float64)
    if numbers.shape != shape:
        raise ValueError(f"{argument}: has shape {numbers.shape}, expected {shape}")
    return numbers


def _quaternion(turn: Any) -> FloatArray:
    """The quaternion x, y, z, w of a rotation."""
    if hasattr(turn, "as_quat"):
        numbers = np.array(turn.as_quat(), dtype=np.float64)
        if numbers.ndim != 1:
            raise ValueError(f"rotation: came {len(numbers)} rotations, expected one")
        return numbers
    numbers = np.array(turn, dtype=np.float64)
    if numbers.shape == (4,):
        return numbers
    if numbers.shape != (3, 3):
        raise ValueError(
            f"rotation: has shape {numbers.shape}, expected a Rotation, 3 × 3, or x, y, z, w"
        )
    return _of_matrix(numbers)


def _check_unit(quaternion: FloatArray) -> None:
    """Refuses a quaternion whose length is not 1, as the server does."""
    length = float(np.linalg.norm(quaternion))
    if not abs(length - 1) <= ROTATION_TOLERANCE:
        raise ValueError(f"orientation: has length {length:.6g}, expected a quaternion of length 1")


def _of_matrix(m: FloatArray) -> FloatArray:
    """The quaternion of a rotation matrix, by its largest component (Shepperd, 1978)."""
    is_rotation = np.allclose(m @ m.T, np.eye(3), atol=ROTATION_TOLERANCE)
    if not is_rotation or np.linalg.det(m) < 0:
        raise ValueError("rotation: the matrix is not a rotation, expected R·Rᵀ = 1 and det R = 1")
    trace = m.trace()
    candidates = [m[0, 0], m[1, 1], m[2, 2], trace]
    largest = int(np.argmax(candidates))
    quaternion = np.empty(4)
    if largest == 3:
        quaternion[3] = 1 + trace
        quaternion[:3] = m[2, 1] - m[1, 2], m[0, 2] - m[2, 0], m[1, 0] - m[0, 1]
    else:
        i, j, k = largest, (largest + 1) % 3, (largest + 2) % 3
        quaternion[i] = 1 + m[i, i] - m[j, j] - m[k, k]
        quaternion[j] = m[j, i] + m[i, j]
        quaternion[k] = m[k, i] + m[i, k]
        quaternion[3] = m[k, j] - m[j, k]
    return np.asarray(quaternion / np.linalg.norm(quaternion), dtype=np.float64)
