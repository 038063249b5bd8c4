"""Answers: what is touched, and where it is; of the server and of `palpate.local` alike."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from palpate import pictures
from palpate.pose import FloatArray, Pose
from palpate.values import Value


@dataclass(frozen=True)
class ObjectProbability:
    """The probability of one object."""

    name: str
    probability: float
    id: str | None
    """Id on the server."""


@dataclass(frozen=True, eq=False)
class SymmetryAxis(Value):
    """An axis about which turns leave an object unchanged, in the session frame."""

    point: FloatArray
    direction: FloatArray
    order: int | None
    """Number of turns that look alike; None for all."""


@dataclass(frozen=True, eq=False, repr=False)
class Hypothesis(Value):
    """A likely pose of one object. Do not average hypotheses."""

    name: str
    weight: float
    """Probability of this object in this pose."""
    pose: Pose
    """`session_from_object`; its origin is the centroid of the mesh or of the touches."""
    session_from_model: Pose
    """Pose of the frame of the mesh file or of the training readings."""
    covariance: FloatArray
    """6 × 6: x, y, z, then rotation about the session's fixed axes."""
    symmetry: list[SymmetryAxis]
    id: str | None
    """Id of the object on the server."""

    def __repr__(self) -> str:
        """The object, its weight and its pose in a line."""
        return f"Hypothesis({self.name} {self.weight:.1%}, {self.session_from_model!r})"


@dataclass(frozen=True)
class StopAdvice:
    """Whether a stated risk is reached."""

    risk: float
    found: float
    """Risk that the likeliest answer is wrong if you stop as soon as it allows."""
    reached: bool


@dataclass(frozen=True)
class Warning:
    """Input that was accepted but is probably a mistake."""

    code: str
    pointer: str
    detail: str


@dataclass(frozen=True, eq=False, repr=False)
class Belief(Value):
    """The belief over the identity and pose of the touched object."""

    objects: list[ObjectProbability]
    """Likeliest first; with `unknown` the probabilities sum to 1."""
    unknown: float
    """Probability of "none of these"."""
    poses: list[Hypothesis]
    """Likeliest first."""
    n_readings: int
    entropy_bits: float
    calibrated: bool
    """Whether the probabilities are calibrated; otherwise they are a ranking."""
    uncalibrated_reason: str | None
    stop: StopAdvice | None
    """None without a stated risk."""
    warnings: list[Warning]
    """Probable mistakes in what was sent."""
    session: str | None
    revision: int | None

    @property
    def best(self) -> str | None:
        """Name of the likeliest answer; None for "none of these"."""
        if not self.objects or self.unknown >= self.objects[0].probability:
            return None
        return self.objects[0].name

    def __repr__(self) -> str:
        """The answer in a line."""
        answer = self.best or "none of these"
        sure = self.probability(self.best) if self.best else self.unknown
        return (
            f"Belief({answer} {sure:.1%}, none of these {self.unknown:.1%}, "
            f"{len(self.objects)} objects, {self.n_readings} readings)"
        )

    def _repr_html_(self) -> str:
        """The likeliest answers as bars, for a notebook."""
        rows = [(one.name, one.probability) for one in self.objects[:9]]
        rows.append(("none of these", self.unknown))
        title = f"{self.n_readings} readings, {self.entropy_bits:.2f} bits"
        return pictures.bars(sorted(rows, key=lambda row: -row[1]), title)

    def to_frame(self) -> Any:
        """The poses as a pandas `DataFrame`: a row a hypothesis, metres; needs pandas."""
        import pandas

        columns = ("x", "y", "z", "qx", "qy", "qz", "qw")
        rows = [
            {"name": one.name, "weight": one.weight}
            | dict(zip(columns, one.pose.numbers.tolist(), strict=True))
            for one in self.poses
        ]
        return pandas.DataFrame(rows, columns=["name", "weight", *columns])

    def probability(self, name: str) -> float:
        """Probability of the object with a name."""
        for one in self.objects:
            if one.name == name:
                return one.probability
        known = ", ".join(one.name for one in self.objects)
        raise KeyError(f"there is no object {name!r}, expected one of {known}")

    @classmethod
    def from_wire(cls, document: dict[str, Any]) -> Belief:
        """The belief of an answer."""
        stop = document.get("stop")
        return cls(
            objects=[
                ObjectProbability(one["name"], one["probability"], one.get("object"))
                for one in document["objects"]
            ],
            unknown=document.get("unknown", 0.0),
            poses=[_hypothesis(one) for one in document["poses"]],
            n_readings=document["n_readings"],
            entropy_bits=document["entropy_bits"],
            calibrated=document.get("calibrated", False),
            uncalibrated_reason=document.get("uncalibrated_reason"),
            stop=StopAdvice(stop["risk"], stop["found"], stop["reached"]) if stop else None,
            warnings=warnings_of(document),
            session=document.get("session"),
            revision=document.get("revision"),
        )


def warnings_of(document: dict[str, Any]) -> list[Warning]:
    """The warnings of an answer."""
    return [
        Warning(one["code"], one["pointer"], one["detail"])
        for one in document.get("warnings") or []
    ]


def _hypothesis(document: dict[str, Any]) -> Hypothesis:
    return Hypothesis(
        name=document["name"],
        weight=document["weight"],
        pose=Pose.from_wire(document["pose"]),
        session_from_model=Pose.from_wire(document["session_from_model"]),
        covariance=np.array(document["covariance"], dtype=np.float64).reshape(6, 6),
        symmetry=[_axis(one) for one in document.get("symmetry") or []],
        id=document.get("object"),
    )


def _axis(document: dict[str, Any]) -> SymmetryAxis:
    point, direction = document["point"], document["direction"]
    return SymmetryAxis(np.array(point), np.array(direction), document.get("order"))
