"""Retries: only where they cannot do the work twice.

Repeatable calls (reads, writes of a whole state, readings with `robot` and `seq`) are retried
after lost connections, time-outs, 429, 502, 503 and 504. All others are retried only if the
server certainly did nothing: no connection, or a refusal with 429 or 503. The server's
`Retry-After` takes precedence over the growing pause.
"""

from __future__ import annotations

import random
from dataclasses import dataclass

from palpate.errors import (
    BrokenError,
    PalpateError,
    ProblemError,
    StatusError,
    TimedOutError,
    UnreachableError,
)


@dataclass(frozen=True)
class RetryPolicy:
    """Number of attempts and pauses between them."""

    attempts_max: int = 5
    """Maximum number of attempts; 1 disables retries."""
    pause_min: float = 0.1
    """Seconds before the second attempt; they double from then on, with jitter."""
    pause_max: float = 10.0
    """Longest pause in seconds. If the server asks for a longer one, the call fails."""

    def pause(self, error: PalpateError, attempt: int, is_harmless: bool) -> float | None:
        """Seconds before the attempt after `attempt` (1, 2, …); None to give up."""
        if attempt >= self.attempts_max or not is_worth_repeating(error, is_harmless):
            return None
        wish = error.retry_after if isinstance(error, StatusError) else None
        if wish is not None:
            return max(wish, 0.001) if wish <= self.pause_max else None
        planned = float(min(self.pause_min * 2 ** (attempt - 1), self.pause_max))
        return planned * random.uniform(1.0, 2.0)


NEVER = RetryPolicy(attempts_max=1)
"""A policy without retries."""


def is_worth_repeating(error: PalpateError, is_harmless: bool) -> bool:
    """Whether a failed call should be tried again. `is_harmless`: repeating changes nothing."""
    status = error.status if isinstance(error, StatusError) else None
    # A server that is shutting down or cannot write will not recover in a moment.
    if isinstance(error, ProblemError) and error.kind == "unavailable" and not error.retry_after:
        return False
    if isinstance(error, UnreachableError) or status in (429, 503):
        return True
    return is_harmless and (isinstance(error, TimedOutError | BrokenError) or status in (502, 504))
