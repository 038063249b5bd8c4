"""Palpate for Python: recognise objects by touch.

`Client` and `AsyncClient` talk to a server; `palpate.local` trains, simulates and recognises
without one. docs/python.md is the guide. SI units, quaternions x, y, z, w.
"""

from palpate import local
from palpate.belief import (
    Belief,
    Hypothesis,
    ObjectProbability,
    StopAdvice,
    SymmetryAxis,
    Warning,
)
from palpate.client import AsyncClient, Client
from palpate.documents import (
    Added,
    Job,
    NextTouch,
    NextTouches,
    ObjectInfo,
    SensorInfo,
    Session,
    Truth,
)
from palpate.errors import (
    BrokenError,
    BusyError,
    ConflictError,
    FieldError,
    ForbiddenError,
    InvalidValueError,
    JobFailedError,
    NotFoundError,
    PalpateError,
    ProblemError,
    SessionEndedError,
    StatusError,
    TimedOutError,
    UnexpectedError,
    UnreachableError,
)
from palpate.events import BeliefEvent, ClosedEvent, DeletedEvent, SessionEvent
from palpate.pose import Pose
from palpate.readings import Readings
from palpate.retry import RetryPolicy
from palpate.touch_session import AsyncTouchSession, TouchSession

__all__ = [
    "Added",
    "AsyncClient",
    "AsyncTouchSession",
    "Belief",
    "BeliefEvent",
    "BrokenError",
    "BusyError",
    "Client",
    "ClosedEvent",
    "ConflictError",
    "DeletedEvent",
    "FieldError",
    "ForbiddenError",
    "Hypothesis",
    "InvalidValueError",
    "Job",
    "JobFailedError",
    "NextTouch",
    "NextTouches",
    "NotFoundError",
    "ObjectInfo",
    "ObjectProbability",
    "PalpateError",
    "Pose",
    "ProblemError",
    "Readings",
    "RetryPolicy",
    "SensorInfo",
    "Session",
    "SessionEndedError",
    "SessionEvent",
    "StatusError",
    "StopAdvice",
    "SymmetryAxis",
    "TimedOutError",
    "TouchSession",
    "Truth",
    "UnexpectedError",
    "UnreachableError",
    "Warning",
    "local",
]
