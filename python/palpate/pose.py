"""Poses: where a sensor or an object is.

A pose `a_from_b` maps coordinates of frame b into frame a. It is a position in metres and a
quaternion in the order x, y, z, w.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Union

import numpy as np
import numpy.typing as npt

if TYPE_CHECKING:
    from scipy.spatial.transform import Rotation

FloatArray = npt.NDArray[np.float64]

ROTATION_TOLERANCE = 1e-2
"""Largest deviation of a matrix from a rotation, as of the server's quaternions."""


@dataclass(frozen=True, eq=False)
class Pose:
    """A pose. Build it with `Pose.of` from a 4 × 4 matrix or a rotation and a translation."""

    position: FloatArray
    """x, y, z, metres."""
    orientation: FloatArray
    """Quaternion x, y, z, w."""

    @classmethod
    def of(cls, given: PoseLike) -> Pose:
        """The pose of a 4 × 4 matrix, seven numbers (x, y, z, qx, qy, qz, qw), or a pair.

        A pair is a rotation and a translation: a scipy `Rotation`, a 3 × 3 matrix or a
        quaternion (x, y, z, w), and three metres.
        """
        if isinstance(given, Pose):
            return given
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
    def from_wire(cls, document: dict[str, Any]) -> Pose:
        """The pose of an answer."""
        position = np.array(document["position"], dtype=np.float64)
        return cls(position, np.array(document["orientation"], dtype=np.float64))

    def to_wire(self) -> dict[str, list[float]]:
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

    def __matmul__(self, other: Pose) -> Pose:
        """The product: `a_from_b @ b_from_c` is `a_from_c`."""
        return Pose.of(self.matrix @ other.matrix)

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
    rows = [Pose.of(one).numbers for one in given]  # type: ignore[union-attr]
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
        return _numbers("rotation", turn.as_quat(), (4,))
    numbers = np.array(turn, dtype=np.float64)
    if numbers.shape == (4,):
        return numbers
    if numbers.shape != (3, 3):
        raise ValueError(
            f"rotation: has shape {numbers.shape}, expected a Rotation, 3 × 3, or x, y, z, w"
        )
    return _of_matrix(numbers)


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
