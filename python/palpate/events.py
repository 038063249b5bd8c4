"""Server-sent events: parsing, and when to reconnect. No I/O here.

Each event carries the whole state, so a client that reconnects misses nothing that matters.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

from palpate.belief import Belief
from palpate.documents import Job, Session
from palpate.errors import PalpateError, UnexpectedError
from palpate.retry import RetryPolicy
from palpate.steps import Document, Request

T = TypeVar("T")

SILENCE_MAX = 45.0
"""Seconds of silence after which a stream is reopened. The server sends a comment every 15 s."""

LINE_MAX = 64 * 1024 * 1024
"""Largest event in bytes: beliefs over large catalogues take megabytes."""


@dataclass(frozen=True)
class BeliefEvent:
    """The belief changed."""

    belief: Belief


@dataclass(frozen=True)
class ClosedEvent:
    """The session was closed; the stream ends."""

    session: Session


@dataclass(frozen=True)
class DeletedEvent:
    """The session was deleted; the stream ends."""

    session: str
    """Id of the session."""


SessionEvent = BeliefEvent | ClosedEvent | DeletedEvent


def session_event(document: Document) -> SessionEvent:
    """The event of a session's stream."""
    kind = document["kind"]
    if kind == "belief":
        return BeliefEvent(Belief.from_wire(document["belief"]))
    if kind == "closed":
        return ClosedEvent(Session.from_wire(document["session"]))
    if kind == "deleted":
        return DeletedEvent(document["session"])
    raise KeyError(f"there is no kind of event {kind!r}")


def ends_session(event: SessionEvent) -> bool:
    """Whether no event follows."""
    return not isinstance(event, BeliefEvent)


def ends_job(job: Job) -> bool:
    """Whether no event follows."""
    return job.is_final


class Follower(Generic[T]):
    """The state of one stream across connections: the last event, failures in a row, the end."""

    def __init__(
        self,
        request: Request,
        parse: Callable[[Document], T],
        is_last: Callable[[T], bool],
        policy: RetryPolicy,
    ) -> None:
        self._request = request
        self._parse = parse
        self._is_last = is_last
        self._policy = policy
        self._data: list[str] = []
        self._size = 0
        self._id = ""
        self._last_id = ""
        self._failures = 0
        self.has_ended = False

    def request(self) -> Request:
        """The request that opens the stream, after the last event."""
        self._data, self._size, self._id = [], 0, self._last_id
        if not self._last_id:
            return self._request
        return self._request.with_header("last-event-id", self._last_id)

    def line(self, line: str) -> T | None:
        """Takes a line; the event that it completes."""
        if not line:
            data, self._data, self._size = self._data, [], 0
            return self._event("\n".join(data)) if data else None
        name, _, value = line.partition(":")
        value = value.removeprefix(" ")
        if name == "data":
            self._size += len(value)
            if self._size > LINE_MAX:
                raise UnexpectedError(f"{self._request.target} sent an event without an end")
            self._data.append(value)
        elif name == "id":
            self._id = value
        return None

    def pause(self, error: PalpateError | None) -> float:
        """Seconds before the stream is reopened after a failure or an end that was too early.

        Raises the error if reopening is no use.
        """
        self._failures += 1
        if error is None:
            # The server ended the stream, as it does when it stops.
            return float(min(self._policy.pause_min * 2**self._failures, self._policy.pause_max))
        pause = self._policy.pause(error, self._failures, True)
        if pause is None:
            raise error
        return pause

    def _event(self, data: str) -> T:
        try:
            event = self._parse(json.loads(data))
        except (ValueError, KeyError, TypeError) as error:
            words = f"{self._request.target} sent an event that cannot be read: {error!r}"
            raise UnexpectedError(words) from error
        self._failures, self._last_id = 0, self._id
        self.has_ended = self._is_last(event)
        return event
