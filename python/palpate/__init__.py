"""Palpate for Python: recognise objects by touch.

`Client` and `AsyncClient` talk to a server; `palpate.local` trains, simulates and recognises
without one. docs/python.md is the guide. SI units, quaternions x, y, z, w.
"""

from importlib.metadata import version

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
    ClosedClientError,
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
from palpate.readings import Reading, Readings
from palpate.retry import RetryPolicy
from palpate.touch_session import AsyncTouchSession, TouchSession

__version__ = version("palpate")

__all__ = [
    "Added",
    "AsyncClient",
    "AsyncTouchSession",
    "Belief",
    "BeliefEvent",
    "BrokenError",
    "BusyError",
    "Client",
    "ClosedClientError",
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
    "Reading",
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
    "__version__",
    "local",
]
