"""Errors of calls. An error of the server carries its problem document (RFC 9457)."""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from datetime import datetime, timezone
from email.utils import parsedate_to_datetime
from typing import Any

BODY_SHOWN_MAX = 200
"""Length at which a body other than a problem document is cut off in messages."""

PREFIX = "urn:palpate:problem:"


class PalpateError(Exception):
    """Base of all errors of this package's client."""


class UnreachableError(PalpateError, ConnectionError):
    """The connection failed: the server did certainly nothing."""


class TimedOutError(PalpateError, TimeoutError):
    """The server did not answer in time; whether the request took effect is unknown."""


class BrokenError(PalpateError, ConnectionError):
    """The connection broke during the answer; whether the request took effect is unknown."""


class ClosedClientError(PalpateError):
    """The client was closed before the call."""


class UnexpectedError(PalpateError):
    """The answer has an unexpected form: the server has another version."""


class JobFailedError(PalpateError):
    """A job that was waited for failed or was cancelled; `job` is its last state."""

    def __init__(self, message: str, job: Any) -> None:
        super().__init__(message)
        self.job = job


class StatusError(PalpateError):
    """A refusal. Without a problem document it comes from something between, such as a proxy."""

    def __init__(self, message: str, status: int, retry_after: float | None) -> None:
        super().__init__(message)
        self.status = status
        self.retry_after = retry_after
        """Seconds until a retry, if the server states them."""


@dataclass(frozen=True)
class FieldError:
    """One field of a request that is wrong."""

    pointer: str
    """JSON pointer into the body, `?name` for the query, `header:name` for a header."""
    detail: str


class ProblemError(StatusError):
    """The server refused the request."""

    def __init__(self, problem: dict[str, Any], retry_after: float | None) -> None:
        self.kind: str = str(problem.get("type", "")).removeprefix(PREFIX)
        """Type of the problem, such as `invalid-value` (docs/http.md lists them)."""
        self.title: str = problem.get("title", "")
        self.detail: str = problem.get("detail", "")
        self.request_id: str = problem.get("request_id", "")
        self.errors: list[FieldError] = [
            FieldError(one["pointer"], one["detail"]) for one in problem.get("errors") or []
        ]
        """The invalid fields."""
        super().__init__(self._words(), int(problem["status"]), retry_after)

    @property
    def field(self) -> str | None:
        """Pointer of the first invalid field, if the problem names any."""
        return self.errors[0].pointer if self.errors else None

    def _words(self) -> str:
        words = self.detail
        for one in self.errors:
            is_said = one.detail in self.detail
            if is_said and not one.pointer:
                continue
            words += f" ({one.pointer})" if is_said else f"; {one.pointer}: {one.detail}"
        return words


class InvalidValueError(ProblemError, ValueError):
    """422: a value is wrong; `errors` and `field` name it."""


class NotFoundError(ProblemError, LookupError):
    """404: the resource that the path names does not exist."""


class ConflictError(ProblemError):
    """409: the name is taken, or the state does not allow it."""


class SessionEndedError(ProblemError):
    """410: the session has ended."""


class ForbiddenError(ProblemError, PermissionError):
    """401 or 403: the key is missing, not valid, or of another role."""


class BusyError(ProblemError):
    """429 or 503: try again after `retry_after` seconds."""


BY_STATUS: dict[int, type[ProblemError]] = {
    401: ForbiddenError,
    403: ForbiddenError,
    404: NotFoundError,
    409: ConflictError,
    410: SessionEndedError,
    422: InvalidValueError,
    429: BusyError,
    503: BusyError,
}


def seconds_to_wait(retry_after: str | None, date: str | None) -> float | None:
    """The wait by a `Retry-After` header: seconds, or a date, which counts from the header `Date`.

    A machine's own clock counts if there is no `Date`. None without a readable header.
    """
    text = (retry_after or "").strip()
    if text.isascii() and text.isdigit():
        seconds = float(text)
        return seconds if math.isfinite(seconds) else None
    until = _http_date(text)
    if until is None:
        return None
    sent = _http_date(date or "") or datetime.now(timezone.utc)
    return max(0.0, (until - sent).total_seconds())


def _http_date(text: str) -> datetime | None:
    try:
        date = parsedate_to_datetime(text)
    except (ValueError, OverflowError):
        return None
    return date if date.tzinfo else date.replace(tzinfo=timezone.utc)


def of_answer(
    url: str, status: int, retry_after: str | None, date: str | None, body: bytes
) -> StatusError:
    """The error of a refusal."""
    wait = seconds_to_wait(retry_after, date)
    try:
        problem = json.loads(body)
    except ValueError:
        problem = None
    if isinstance(problem, dict) and {"type", "status", "detail"} <= problem.keys():
        return BY_STATUS.get(status, ProblemError)(problem, wait)
    shown = body[:BODY_SHOWN_MAX].decode(errors="replace")
    words = f"{url} answered {status} without a problem document: {shown}"
    return StatusError(words, status, wait)
