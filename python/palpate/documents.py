"""Resources of the server. `document` holds everything that the API returned."""

from __future__ import annotations

from dataclasses import dataclass, field

from palpate.belief import Belief, Warning, warnings_of
from palpate.pose import Pose
from palpate.steps import Document


@dataclass(frozen=True)
class ObjectInfo:
    """An object to recognise."""

    id: str
    name: str
    description: str
    n_readings: int
    has_mesh: bool
    document: Document = field(repr=False)

    @classmethod
    def from_wire(cls, document: Document) -> ObjectInfo:
        """The object of an answer."""
        return cls(
            document["id"],
            document["name"],
            document["description"],
            document["n_readings"],
            document.get("mesh") is not None,
            document,
        )


@dataclass(frozen=True)
class SensorInfo:
    """A sensor that the server knows."""

    id: str
    name: str
    preset: str | None
    calibration: int | None
    """Number of its newest calibration."""
    passport: int | None
    """Number of the calibration that brought its passport."""
    document: Document = field(repr=False)

    @classmethod
    def from_wire(cls, document: Document) -> SensorInfo:
        """The sensor of an answer."""
        return cls(
            document["id"],
            document["name"],
            document.get("preset"),
            document.get("calibration"),
            document.get("passport"),
            document,
        )


@dataclass(frozen=True)
class Job:
    """A training, a recalibration or a comparison of versions."""

    id: str
    catalogue: str
    state: str
    """queued, running, succeeded, failed or cancelled."""
    stage: str | None
    done: int
    total: int
    version: int | None
    """The version that it made."""
    reason: str | None
    """Why it failed."""
    document: Document = field(repr=False)

    @property
    def is_final(self) -> bool:
        """Whether it has ended."""
        return self.state not in ("queued", "running")

    @classmethod
    def from_wire(cls, document: Document) -> Job:
        """The job of an answer."""
        return cls(
            document["id"],
            document["catalogue"],
            document["state"],
            document.get("stage"),
            document["done"],
            document["total"],
            document.get("version"),
            document.get("reason"),
            document,
        )


@dataclass(frozen=True)
class Truth:
    """The reported truth of a session."""

    name: str | None
    """The object; None for "none of these"."""
    probability: float
    """What the belief gave it."""
    was_right: bool
    """Whether it was the likeliest answer."""
    pose: Pose | None = None
    """Its true pose, if that was reported."""
    position_error: float | None = None
    """Distance of the believed pose from it, in metres."""
    angle_error: float | None = None
    """Angle between the two up to the object's symmetry, in radians."""

    @classmethod
    def from_wire(cls, document: Document) -> Truth:
        """The truth of an answer."""
        pose = document.get("pose")
        return cls(
            document.get("name"),
            document["probability"],
            document["was_right"],
            None if pose is None else Pose.from_wire(pose),
            document.get("position_error"),
            document.get("angle_error"),
        )


@dataclass(frozen=True)
class Session:
    """A session."""

    id: str
    catalogue: str
    version: int
    method: str
    frame_id: str | None
    state: str
    """open or closed."""
    n_readings: int
    truth: Truth | None
    document: Document = field(repr=False)

    @classmethod
    def from_wire(cls, document: Document) -> Session:
        """The session of an answer."""
        truth = document.get("truth")
        return cls(
            document["id"],
            document["catalogue"],
            document["version"],
            document["method"],
            document.get("frame_id"),
            document["state"],
            document["n_readings"],
            Truth.from_wire(truth) if truth else None,
            document,
        )


@dataclass(frozen=True)
class Added:
    """Readings that were added."""

    n_new: int
    n_repeated: int
    """Those that were known already; they count once."""
    n_readings: int
    """All readings of the session or object."""
    warnings: list[Warning]
    belief: Belief | None
    """The belief after them, in sessions."""

    @classmethod
    def from_wire(cls, document: Document) -> Added:
        """What an answer says of readings that were added."""
        belief = document.get("belief")
        return cls(
            document["n_new"],
            document["n_repeated"],
            document["n_readings"],
            warnings_of(document),
            Belief.from_wire(belief) if belief else None,
        )


@dataclass(frozen=True, eq=False)
class NextTouch:
    """A ranked approach: from a pose straight along the sensor's +z until contact."""

    pose: Pose
    reach_m: float
    information_bits: float
    """Expected information about the identity."""
    pose_bits: float
    """Expected information about the pose."""
    contact_probability: float
    candidate: int | None
    """Index of the candidate, if candidates were given."""
    bits_per_cost: float | None


@dataclass(frozen=True, eq=False)
class NextTouches:
    """Ranked approaches, best first."""

    touches: list[NextTouch]
    complete: bool
    """Whether all approaches were evaluated within the deadline."""
    evaluated: int
    entropy_bits: float

    @classmethod
    def from_wire(cls, document: Document) -> NextTouches:
        """The approaches of an answer."""
        touches = [
            NextTouch(
                Pose.from_wire(one["pose"]),
                one["reach_m"],
                one["information_bits"],
                one["pose_bits"],
                one["contact_probability"],
                one.get("candidate"),
                one.get("bits_per_cost"),
            )
            for one in document["touches"]
        ]
        entropy = document["entropy_bits"]
        return cls(touches, document["complete"], document["evaluated"], entropy)
