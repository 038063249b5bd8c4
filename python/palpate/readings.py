"""Readings of one sensor as arrays, for the server and for training and recognition here."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any, overload

import numpy as np
import numpy.typing as npt

from palpate import pictures
from palpate.pose import FloatArray, Pose, PoseLike, poses_array
from palpate.values import Value


@dataclass(frozen=True, eq=False, repr=False)
class Reading(Value):
    """One press."""

    pose: Pose
    """`session_from_sensor`."""
    image: FloatArray
    """Taxels, pascal, as the driver sends them; NaN for a missing taxel."""

    def __repr__(self) -> str:
        return f"Reading({self.image.size} taxels, {self.pose!r})"


@dataclass(frozen=True, eq=False, repr=False)
class Readings(Value):
    """Presses of one sensor: n poses and n images. Build them with `Readings.of`."""

    poses: FloatArray
    """n × 7: `session_from_sensor` as x, y, z, qx, qy, qz, qw."""
    images: FloatArray
    """n × taxels, pascal, as the driver sends them; NaN for a missing taxel."""

    @classmethod
    def of(cls, poses: Sequence[PoseLike] | npt.ArrayLike, images: npt.ArrayLike) -> Readings:
        """The readings of poses (n × 4 × 4, n × 7 or a list) and images (n × taxels).

        Images may also have rows and columns (n × rows × cols).
        """
        numbers = real("images", images)
        if numbers.ndim < 2:
            raise ValueError(f"images: have shape {numbers.shape}, expected n × taxels")
        placed = poses_array(poses)
        if len(placed) != len(numbers):
            raise ValueError(f"images: {len(numbers)} came, expected {len(placed)}: one a pose")
        return cls(placed, numbers.reshape(len(numbers), int(np.prod(numbers.shape[1:]))))

    def __len__(self) -> int:
        return len(self.poses)

    @overload
    def __getitem__(self, chosen: int) -> Reading: ...
    @overload
    def __getitem__(self, chosen: slice | npt.NDArray[np.integer[Any]]) -> Readings: ...
    def __getitem__(self, chosen: int | slice | npt.NDArray[np.integer[Any]]) -> Reading | Readings:
        """The reading of an index; the readings of a slice or of an array of indices."""
        if isinstance(chosen, int | np.integer):
            return Reading(Pose.of(self.poses[chosen]), self.images[chosen])
        return Readings(self.poses[chosen], self.images[chosen])

    def __iter__(self) -> Iterator[Reading]:
        """The readings, one by one."""
        return (self[index] for index in range(len(self)))

    def __repr__(self) -> str:
        return f"Readings({len(self)} of {self.images.shape[1]} taxels)"

    def _repr_html_(self) -> str:
        """The images as heat maps, for a notebook; as a row where the taxels are no square."""
        n, taxels = self.images.shape
        side = round(taxels**0.5)
        rows = side if side * side == taxels else 1
        return pictures.heat(self.images.reshape(n, rows, taxels // rows), repr(self))

    def moved(self, other_from_session: PoseLike) -> Readings:
        """The same presses seen from another frame."""
        moved = Pose.of(other_from_session)
        poses = [moved @ Pose.of(pose) for pose in self.poses]
        return Readings(poses_array(poses), self.images)

    def to_wire(
        self, sensor: str, *, robot: str | None = None, first_seq: int = 0
    ) -> list[dict[str, Any]]:
        """The readings in a request. `robot` makes repeated ones count once."""
        documents = []
        for index, (pose, image) in enumerate(zip(self.poses, self.images, strict=True)):
            reading: dict[str, Any] = {
                "sensor": sensor,
                "pose": Pose.of(pose).to_wire(),
                "image": image_to_wire(image),
            }
            if robot is not None:
                reading |= {"robot": robot, "seq": first_seq + index}
            documents.append(reading)
        return documents


def real(argument: str, given: npt.ArrayLike) -> FloatArray:
    """Real numbers, from anything that holds such; None is NaN."""
    array = np.asarray(given)
    if array.dtype.kind not in "biufO":
        raise ValueError(f"{argument}: are of type {array.dtype}, expected real numbers")
    return np.array(array, dtype=np.float64)


def image_to_wire(image: npt.ArrayLike) -> list[float | None]:
    """The values of an image in a request, null for NaN."""
    values: list[float] = real("image", image).ravel().tolist()
    return [None if value != value else value for value in values]
