"""The client of a server: two transports for the operations of `operations.py`."""

from __future__ import annotations

import asyncio
import os
import ssl
import time
from collections.abc import AsyncIterator, Iterator
from contextlib import aclosing
from ipaddress import ip_address
from types import TracebackType
from typing import TYPE_CHECKING, Any, TypeVar

import httpx

from palpate import events
from palpate.documents import Job
from palpate.errors import (
    BrokenError,
    ClosedClientError,
    PalpateError,
    TimedOutError,
    UnreachableError,
    of_answer,
)
from palpate.events import Follower, SessionEvent
from palpate.operations import Operations
from palpate.retry import RetryPolicy
from palpate.steps import AsyncRunner, Exchange, Request, Sleep, Step, SyncRunner, attempts, get
from palpate.touch_session import AsyncTouchSession, TouchSession

if TYPE_CHECKING:
    from typing_extensions import Unpack

    from palpate.options import SessionOptions

T = TypeVar("T")

ADDRESS = "http://127.0.0.1:7411"
CONNECT_TIMEOUT = 3.0
AGENT = "palpate-python/0.1.0"


class Settings:
    """Address, key and limits of a client; the same for both transports."""

    def __init__(
        self,
        address: str | None,
        key: str | None,
        authority: str | os.PathLike[str] | None,
        timeout: float,
        retry: RetryPolicy | None,
    ) -> None:
        self.arguments = (address, key, authority, timeout, retry)
        given = address or os.environ.get("PALPATE_SERVER") or ADDRESS
        self.url = httpx.URL(given.rstrip("/"))
        if self.url.scheme not in ("http", "https") or not self.url.host:
            words = f"address: came {given!r}, expected the address of a server like {ADDRESS}"
            raise ValueError(words)
        self.retry = retry or RetryPolicy()
        key = (key or os.environ.get("PALPATE_KEY") or "").strip()
        if not all("!" <= letter <= "~" for letter in key):
            raise ValueError("key: has spaces or characters that no key has")
        headers = {"user-agent": AGENT}
        if key:
            headers["authorization"] = f"Bearer {key}"
        self.options: dict[str, Any] = {
            "headers": headers,
            "timeout": httpx.Timeout(timeout, connect=CONNECT_TIMEOUT),
            "follow_redirects": False,
            "trust_env": not _is_loopback(self.url.host),
        }
        if authority is not None:
            self.options["verify"] = ssl.create_default_context(cafile=os.fspath(authority))

    def parts(self, request: Request) -> dict[str, Any]:
        """The arguments of httpx for a request."""
        return {
            "method": request.method,
            "url": f"{self.url}{request.target}",
            "headers": dict(request.headers),
            "content": request.content,
        }

    def stream_parts(self, request: Request) -> dict[str, Any]:
        """The arguments of httpx for an event stream, which has no end."""
        timeout = httpx.Timeout(events.SILENCE_MAX, connect=CONNECT_TIMEOUT)
        accepts = {**dict(request.headers), "accept": "text/event-stream"}
        return {**self.parts(request), "headers": accepts, "timeout": timeout}


class Client(Operations, SyncRunner):
    """A client of one server. Keep it; it holds connections. Safe to use from several threads.

    `address` and `key` default to the environment's PALPATE_SERVER and PALPATE_KEY; `authority`
    is a PEM file of the authority to trust. `timeout` limits each attempt, in seconds.
    """

    def __init__(
        self,
        address: str | None = None,
        *,
        key: str | None = None,
        authority: str | os.PathLike[str] | None = None,
        timeout: float = 60.0,
        retry: RetryPolicy | None = None,
    ) -> None:
        self._settings = Settings(address, key, authority, timeout, retry)
        self._http = httpx.Client(**self._settings.options)

    @property
    def address(self) -> str:
        """Address of the server."""
        return str(self._settings.url)

    def __repr__(self) -> str:
        return f"Client({self.address!r})"

    def __enter__(self) -> Client:
        """Returns the client."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Closes the connections."""
        self.close()

    def close(self) -> None:
        """Closes the connections."""
        self._http.close()

    def touch_session(
        self, robot: str, *, sensor: str | None = None, **options: Unpack[SessionOptions]
    ) -> TouchSession:
        """A session for one robot, to be opened with `with`.

        `sensor` is the default of its touches; `options` as in `CreateSession` of the API.
        """
        return TouchSession(self, robot, sensor, **options)

    def session_events(self, session: str) -> Iterator[SessionEvent]:
        """Follows a session, the current belief first, until it is closed or deleted.

        Reopens a broken stream.
        """
        request = get("v1", "sessions", session, "events")
        return self._follow(self._follower(request, events.session_event, events.ends_session))

    def job_events(self, job: str) -> Iterator[Job]:
        """Follows a job to its end. Reopens a broken stream."""
        request = get("v1", "jobs", job, "events")
        return self._follow(self._follower(request, Job.from_wire, events.ends_job))

    def _follower(self, request: Request, parse: Any, is_last: Any) -> Any:
        return Follower(request, parse, is_last, self._settings.retry)

    def _follow(self, follower: Follower[T]) -> Iterator[T]:
        while not follower.has_ended:
            failure: PalpateError | None = None
            try:
                for line in self._lines(follower.request()):
                    event = follower.line(line)
                    if event is not None:
                        yield event
                    if follower.has_ended:
                        return
            except PalpateError as error:
                failure = error
            time.sleep(follower.pause(failure))

    def _lines(self, request: Request) -> Iterator[str]:
        _refuse_closed(self._http)
        parts = self._settings.stream_parts(request)
        try:
            with self._http.stream(**parts) as answer:
                if not answer.is_success:
                    raise _refused(answer, answer.read())
                yield from answer.iter_lines()
        except httpx.TransportError as error:
            raise _transport_error(parts["url"], error) from error

    def perform(self, step: Step) -> Any:
        """Performs one step of an operation."""
        if isinstance(step, Request):
            return self.run(attempts(step, self._settings.retry))
        if isinstance(step, Sleep):
            return time.sleep(step.seconds)
        return self._exchange(step)

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy, or what is read from a pickle, is a new client of the same server."""
        return (_client, (type(self), self._settings.arguments))

    def _exchange(self, exchange: Exchange) -> bytes:
        _refuse_closed(self._http)
        parts = self._settings.parts(exchange.request)
        try:
            answer = self._http.request(**parts)
        except httpx.TransportError as error:
            raise _transport_error(parts["url"], error) from error
        return _accepted(answer)


class AsyncClient(Operations, AsyncRunner):
    """The client for asyncio; arguments and methods are those of `Client`, to be awaited."""

    def __init__(
        self,
        address: str | None = None,
        *,
        key: str | None = None,
        authority: str | os.PathLike[str] | None = None,
        timeout: float = 60.0,
        retry: RetryPolicy | None = None,
    ) -> None:
        self._settings = Settings(address, key, authority, timeout, retry)
        self._http = httpx.AsyncClient(**self._settings.options)

    @property
    def address(self) -> str:
        """Address of the server."""
        return str(self._settings.url)

    def __repr__(self) -> str:
        return f"AsyncClient({self.address!r})"

    async def __aenter__(self) -> AsyncClient:
        """Returns the client."""
        return self

    async def __aexit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Closes the connections."""
        await self.close()

    async def close(self) -> None:
        """Closes the connections."""
        await self._http.aclose()

    def touch_session(
        self, robot: str, *, sensor: str | None = None, **options: Unpack[SessionOptions]
    ) -> AsyncTouchSession:
        """A session for one robot, to be opened with `async with`."""
        return AsyncTouchSession(self, robot, sensor, **options)

    def session_events(self, session: str) -> AsyncIterator[SessionEvent]:
        """Follows a session, the current belief first, until it is closed or deleted."""
        request = get("v1", "sessions", session, "events")
        return self._follow(self._follower(request, events.session_event, events.ends_session))

    def job_events(self, job: str) -> AsyncIterator[Job]:
        """Follows a job to its end. Reopens a broken stream."""
        request = get("v1", "jobs", job, "events")
        return self._follow(self._follower(request, Job.from_wire, events.ends_job))

    def _follower(self, request: Request, parse: Any, is_last: Any) -> Any:
        return Follower(request, parse, is_last, self._settings.retry)

    async def _follow(self, follower: Follower[T]) -> AsyncIterator[T]:
        while not follower.has_ended:
            failure: PalpateError | None = None
            try:
                async with aclosing(self._lines(follower.request())) as lines:
                    async for line in lines:
                        event = follower.line(line)
                        if event is not None:
                            yield event
                        if follower.has_ended:
                            return
            except PalpateError as error:
                failure = error
            await asyncio.sleep(follower.pause(failure))

    async def _lines(self, request: Request) -> Any:
        _refuse_closed(self._http)
        parts = self._settings.stream_parts(request)
        try:
            async with self._http.stream(**parts) as answer:
                if not answer.is_success:
                    raise _refused(answer, await answer.aread())
                async for line in answer.aiter_lines():
                    yield line
        except httpx.TransportError as error:
            raise _transport_error(parts["url"], error) from error

    async def perform(self, step: Step) -> Any:
        """Performs one step of an operation."""
        if isinstance(step, Request):
            return await self.run(attempts(step, self._settings.retry))
        if isinstance(step, Sleep):
            return await asyncio.sleep(step.seconds)
        return await self._exchange(step)

    def __reduce__(self) -> tuple[Any, ...]:
        """A copy, or what is read from a pickle, is a new client of the same server."""
        return (_client, (type(self), self._settings.arguments))

    async def _exchange(self, exchange: Exchange) -> bytes:
        _refuse_closed(self._http)
        parts = self._settings.parts(exchange.request)
        try:
            answer = await self._http.request(**parts)
        except httpx.TransportError as error:
            raise _transport_error(parts["url"], error) from error
        return _accepted(answer)


def _client(kind: type[Any], arguments: tuple[Any, ...]) -> Any:
    """A client of these arguments."""
    address, key, authority, timeout, retry = arguments
    return kind(address, key=key, authority=authority, timeout=timeout, retry=retry)


def _refuse_closed(http: httpx.Client | httpx.AsyncClient) -> None:
    if http.is_closed:
        raise ClosedClientError("the client is closed: make another")


def _accepted(answer: httpx.Response) -> bytes:
    """The body of a success, otherwise the problem."""
    if answer.is_success:
        return answer.content
    raise _refused(answer, answer.content)


def _refused(answer: httpx.Response, body: bytes) -> PalpateError:
    retry_after, date = answer.headers.get("retry-after"), answer.headers.get("date")
    return of_answer(str(answer.url), answer.status_code, retry_after, date, body)


def _transport_error(url: str, error: httpx.TransportError) -> PalpateError:
    if isinstance(error, httpx.ConnectError | httpx.ConnectTimeout | httpx.PoolTimeout):
        return UnreachableError(f"cannot reach {url}: {error}")
    if isinstance(error, httpx.TimeoutException):
        return TimedOutError(f"{url} did not answer in time")
    return BrokenError(f"the connection to {url} broke: {error}")


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False
