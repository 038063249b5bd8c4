"""Operations without I/O: a generator yields requests and pauses, and is sent the answers.

Each operation is described once and run by two transports (`client.py`): `operation` binds it
to a runner, and what it returns there is a value for a sync one and an awaitable for an async
one.
"""

from __future__ import annotations

import functools
import json
from collections.abc import Awaitable, Callable, Coroutine, Generator
from dataclasses import dataclass, replace
from typing import Any, Concatenate, Generic, ParamSpec, TypeVar, overload
from urllib.parse import quote, urlencode

from palpate.errors import PalpateError, UnexpectedError
from palpate.retry import RetryPolicy

T = TypeVar("T")
P = ParamSpec("P")

Document = dict[str, Any]
"""A JSON object of the API, as `schemas/openapi.json` describes it."""


@dataclass(frozen=True)
class Request:
    """A request that can be sent repeatedly."""

    method: str
    path: tuple[str, ...]
    is_harmless: bool
    """Whether repeating it changes nothing."""
    query: tuple[tuple[str, str], ...] = ()
    headers: tuple[tuple[str, str], ...] = ()
    content: bytes | None = None

    @property
    def target(self) -> str:
        """Path and query, with escaped names."""
        path = "".join("/" + quote(part, safe="") for part in self.path)
        return f"{path}?{urlencode(self.query)}" if self.query else path

    def with_query(self, **values: object) -> Request:
        """The request with those values that are not None."""
        given = tuple((name, str(value)) for name, value in values.items() if value is not None)
        return replace(self, query=self.query + given)

    def with_header(self, name: str, value: str) -> Request:
        """The request with a header."""
        return replace(self, headers=(*self.headers, (name, value)))

    def with_json(self, document: Document) -> Request:
        """The request with a document; entries that are None are left out."""
        given = {name: value for name, value in document.items() if value is not None}
        try:
            content = json.dumps(given, allow_nan=False).encode()
        except ValueError as error:
            raise ValueError("the request has a number that is NaN or infinite") from error
        return self.with_content("application/json", content)

    def with_content(self, media_type: str, content: bytes) -> Request:
        """The request with a body."""
        return replace(self, content=content).with_header("content-type", media_type)

    def repeatable(self, is_harmless: bool = True) -> Request:
        """The request, of which repeating is harmless or not."""
        return replace(self, is_harmless=is_harmless)


def get(*path: str) -> Request:
    """A request that reads."""
    return Request("GET", path, True)


def put(*path: str) -> Request:
    """A request that sets the whole state, so repeating it is harmless."""
    return Request("PUT", path, True)


def patch(*path: str) -> Request:
    """A request that sets fields, so repeating it is harmless."""
    return Request("PATCH", path, True)


def post(*path: str) -> Request:
    """A request that is not repeated after an unknown outcome."""
    return Request("POST", path, False)


def delete(*path: str) -> Request:
    """A request not repeated after an unknown outcome: the answer would be "not found"."""
    return Request("DELETE", path, False)


@dataclass(frozen=True)
class Exchange:
    """One attempt of a request."""

    request: Request


@dataclass(frozen=True)
class Sleep:
    """A pause in seconds."""

    seconds: float


Step = Request | Exchange | Sleep
Steps = Generator[Step, Any, T]
"""An operation. A `Request` is answered with its body, after retries."""


def attempts(request: Request, policy: RetryPolicy) -> Steps[bytes]:
    """The attempts of a request."""
    attempt = 1
    while True:
        try:
            body: bytes = yield Exchange(request)
            return body
        except PalpateError as error:
            pause = policy.pause(error, attempt, request.is_harmless)
            if pause is None:
                raise
        yield Sleep(pause)
        attempt += 1


def ask(request: Request, parse: Callable[[Document], T]) -> Steps[T]:
    """A request whose answer is a JSON object."""
    body: bytes = yield request
    try:
        return parse(json.loads(body))
    except (ValueError, KeyError, TypeError) as error:
        words = f"{request.target} answered something unexpected: {error!r}"
        raise UnexpectedError(words) from error


def ask_for_nothing(request: Request) -> Steps[None]:
    """A request without an answer."""
    yield request


def ask_for_bytes(request: Request) -> Steps[bytes]:
    """A request whose answer is a file."""
    body: bytes = yield request
    return body


def pages(request: Request, parse: Callable[[Document], T]) -> Steps[list[T]]:
    """All items of a list, page by page."""
    items: list[T] = []
    cursor: str | None = None
    while True:
        page = yield from ask(request.with_query(limit=1000, cursor=cursor), same)
        items += [parse(item) for item in page["items"]]
        cursor = page.get("next_cursor")
        if cursor is None:
            return items


def same(document: Document) -> Document:
    """The answer as it came."""
    return document


class SyncRunner:
    """Something that runs operations and returns their results."""

    def run(self, steps: Steps[T]) -> T:
        """Runs an operation."""
        resume: Callable[[], Step] = functools.partial(next, steps)
        try:
            while True:
                step = resume()
                try:
                    answer = self.perform(step)
                except PalpateError as error:
                    resume = functools.partial(steps.throw, error)
                else:
                    resume = functools.partial(steps.send, answer)
        except StopIteration as end:
            result: T = end.value
            return result

    def perform(self, step: Step) -> Any:
        """Performs one step of an operation."""
        raise NotImplementedError


class AsyncRunner:
    """Something that runs operations and returns awaitables of their results."""

    async def run(self, steps: Steps[T]) -> T:
        """Runs an operation."""
        resume: Callable[[], Step] = functools.partial(next, steps)
        try:
            while True:
                step = resume()
                try:
                    answer = await self.perform(step)
                except PalpateError as error:
                    resume = functools.partial(steps.throw, error)
                else:
                    resume = functools.partial(steps.send, answer)
        except StopIteration as end:
            result: T = end.value
            return result

    def perform(self, step: Step) -> Awaitable[Any]:
        """Performs one step of an operation."""
        raise NotImplementedError


class operation(Generic[P, T]):
    """A method that describes an operation; on a runner it runs it."""

    def __init__(self, describe: Callable[Concatenate[Any, P], Steps[T]]) -> None:
        self.describe = describe
        self.__doc__ = describe.__doc__

    @overload
    def __get__(self, runner: SyncRunner, owner: Any = None) -> Callable[P, T]: ...
    @overload
    def __get__(
        self, runner: AsyncRunner, owner: Any = None
    ) -> Callable[P, Coroutine[Any, Any, T]]: ...
    @overload
    def __get__(self, runner: None, owner: Any = None) -> operation[P, T]: ...

    def __get__(self, runner: SyncRunner | AsyncRunner | None, owner: Any = None) -> Any:
        """The operation of a runner."""
        if runner is None:
            return self

        def bound(*args: P.args, **kwargs: P.kwargs) -> Any:
            return runner.run(self.describe(runner, *args, **kwargs))

        return functools.update_wrapper(bound, self.describe)
