"""Retries and errors of the transport, against a server that misbehaves as it is told."""

from __future__ import annotations

import asyncio
import json
import socket
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from typing import Any

import pytest

import palpate
from palpate import AsyncClient, Client, RetryPolicy
from palpate.errors import seconds_to_wait
from palpate.steps import get, post
from palpate.touch_session import Stamps

FAST = RetryPolicy(pause_min=0.001, pause_max=1.0)


class Script(ThreadingHTTPServer):
    """A server that plays a list of answers; None drops the connection."""

    daemon_threads = True
    answers: list[Any]
    heard: list[tuple[str, str, dict[str, str]]]

    @property
    def address(self) -> str:
        return f"http://127.0.0.1:{self.server_address[1]}"


class Player(BaseHTTPRequestHandler):
    protocol_version = "HTTP/1.1"
    server: Script

    def do_GET(self) -> None:
        self.play()

    def do_POST(self) -> None:
        self.rfile.read(int(self.headers.get("content-length") or 0))
        self.play()

    def play(self) -> None:
        self.server.heard.append((self.command, self.path, dict(self.headers)))
        answer = self.server.answers.pop(0)
        if answer is None:
            self.close_connection = True
            self.connection.shutdown(socket.SHUT_RDWR)
            return
        status, headers, body = answer
        content = body if isinstance(body, bytes) else json.dumps(body).encode()
        self.send_response(status)
        for name, value in headers.items():
            self.send_header(name, value)
        self.send_header("content-length", str(len(content)))
        self.end_headers()
        self.wfile.write(content)

    def log_message(self, *args: Any) -> None:
        pass


@pytest.fixture
def script() -> Iterator[Script]:
    server = Script(("127.0.0.1", 0), Player)
    server.answers, server.heard = [], []
    thread = threading.Thread(target=server.serve_forever, args=(0.01,))
    thread.start()
    yield server
    server.shutdown()
    thread.join()
    server.server_close()


def problem(status: int, kind: str, **more: Any) -> dict[str, Any]:
    return {
        "type": f"urn:palpate:problem:{kind}",
        "title": "T",
        "status": status,
        "detail": "d",
        "instance": "/",
        "request_id": "r",
        **more,
    }


JOB = {"id": "j", "catalogue": "c", "state": "succeeded", "done": 1, "total": 1}
BUSY = (503, {"retry-after": "0"}, problem(503, "overloaded"))


def test_reads_are_repeated_after_anything_that_passes(script: Script) -> None:
    script.answers = [None, BUSY, (502, {}, b"proxy"), (200, {}, JOB)]
    with Client(script.address, retry=FAST) as client:
        assert client.job("j").state == "succeeded"
    assert len(script.heard) == 4


@pytest.mark.parametrize("first", [None, (502, {}, b"proxy"), (500, {}, problem(500, "internal"))])
def test_what_may_have_happened_is_not_repeated(script: Script, first: Any) -> None:
    script.answers = [first, (200, {}, JOB)]
    with Client(script.address, retry=FAST) as client, pytest.raises(palpate.PalpateError):
        client.start_training()
    assert len(script.heard) == 1


def test_a_refusal_for_now_is_repeated_even_if_harmful(script: Script) -> None:
    script.answers = [(429, {"retry-after": "0"}, problem(429, "too-many-requests"))]
    script.answers += [BUSY, (202, {}, JOB)]
    with Client(script.address, retry=FAST) as client:
        assert client.start_training().id == "j"


def test_readings_are_repeated_only_with_numbers(script: Script) -> None:
    added = {"session": "s", "n_new": 1, "n_repeated": 0, "n_readings": 1, "warnings": []}
    reading = palpate.Readings.of([[0, 0, 0, 0, 0, 0, 1]], [[1.0]])
    with Client(script.address, retry=FAST) as client:
        script.answers = [None, (200, {}, added)]
        assert client.add_readings("s", "x", reading, robot="arm").n_new == 1
        script.answers = [None, (200, {}, added)]
        with pytest.raises(palpate.BrokenError):
            client.add_readings("s", "x", reading)


def test_a_wish_that_is_too_long_fails_at_once(script: Script) -> None:
    script.answers = [(503, {"retry-after": "60"}, problem(503, "overloaded"))]
    with Client(script.address, retry=FAST) as client, pytest.raises(palpate.BusyError) as busy:
        client.job("j")
    assert busy.value.retry_after == 60 and len(script.heard) == 1


@pytest.mark.parametrize(
    ("asked", "seconds"),
    [
        ("30", 30),
        ("Fri, 27 Nov 2026 20:42:30 GMT", 30),
        ("Friday, 27-Nov-26 20:42:30 GMT", 30),
        ("Fri Nov 27 20:42:30 2026", 30),
        ("Thu, 26 Nov 2026 20:42:30 GMT", 0),
        ("soon", None),
        ("-1", None),
        ("1.5", None),
        ("²", None),
        ("9" * 400, None),
        ("Fri, 31 Dec 2026 00:00:00 +99999999999999", None),
        ("", None),
        (None, None),
    ],
)
def test_a_wish_is_seconds_or_a_date(asked: str | None, seconds: float | None) -> None:
    assert seconds_to_wait(asked, "Fri, 27 Nov 2026 20:42:00 GMT") == seconds


def test_attempts_end(script: Script) -> None:
    script.answers = [BUSY] * 9
    with Client(script.address, retry=FAST) as client, pytest.raises(palpate.BusyError):
        client.job("j")
    assert len(script.heard) == FAST.attempts_max


def test_both_transports_repeat_alike(script: Script) -> None:
    async def ask() -> str:
        async with AsyncClient(script.address, retry=FAST) as client:
            return (await client.job("j")).state

    script.answers = [None, BUSY, (200, {}, JOB)]
    assert asyncio.run(ask()) == "succeeded"
    assert len(script.heard) == 3


def test_nobody_listens() -> None:
    with socket.socket() as unused:
        unused.bind(("127.0.0.1", 0))
        address = f"http://127.0.0.1:{unused.getsockname()[1]}"
    with Client(address, retry=FAST) as client, pytest.raises(palpate.UnreachableError):
        client.version()


def test_an_answer_of_something_else_is_told_apart(script: Script) -> None:
    script.answers = [(200, {}, b"<html>"), (404, {}, b"<html>" + b"x" * 999)]
    with Client(script.address, retry=FAST) as client:
        with pytest.raises(palpate.UnexpectedError):
            client.job("j")
        with pytest.raises(palpate.StatusError, match="without a problem document") as other:
            client.job("j")
    assert not isinstance(other.value, palpate.ProblemError) and len(str(other.value)) < 400


def test_a_problem_reads_as_one_line() -> None:
    wrong = [{"pointer": "/readings/0/pose", "detail": "has norm 0, expected 1"}]
    error = palpate.InvalidValueError(problem(422, "invalid-value", errors=wrong), None)
    assert str(error) == "d; /readings/0/pose: has norm 0, expected 1"
    said = problem(422, "invalid-value", errors=wrong, detail="has norm 0, expected 1")
    error = palpate.InvalidValueError(said, None)
    assert str(error) == "has norm 0, expected 1 (/readings/0/pose)"
    assert error.kind == "invalid-value" and error.field == "/readings/0/pose"


def test_names_are_escaped_and_the_key_is_sent(script: Script) -> None:
    script.answers = [(200, {}, {})] * 2
    with Client(f"{script.address}/prefix/", key="palpate_abc") as client:
        client.explain("a/b ü")
        assert "palpate_abc" not in repr(client)
    _, path, headers = script.heard[0]
    assert path == "/prefix/v1/sessions/a%2Fb%20%C3%BC/explain"
    assert headers["authorization"] == "Bearer palpate_abc"
    assert get("v1").with_query(cursor="x&y", limit=None).target == "/v1?cursor=x%26y"
    assert not post("v1").is_harmless


@pytest.mark.parametrize("address", ["127.0.0.1:7411", "ftp://host", "http://"])
def test_an_address_is_checked(address: str) -> None:
    with pytest.raises(ValueError, match="address"):
        Client(address)


def test_a_key_is_checked() -> None:
    with pytest.raises(ValueError, match="key"):
        Client(key="palpate abc")


def test_streams_reopen_after_the_last_event(script: Script) -> None:
    running = json.dumps({**JOB, "state": "running"})
    first = f": hello\nid: 7\ndata: {running}\n\ndata: half".encode()
    rest = f"data: {json.dumps(JOB)}\n\n".encode()
    script.answers = [(200, {}, first), None, (200, {}, rest)]
    with Client(script.address, retry=FAST) as client:
        assert [job.state for job in client.job_events("j")] == ["running", "succeeded"]
    assert [headers.get("last-event-id") for _, _, headers in script.heard] == [None, "7", "7"]


def test_stamps_rise_though_the_clock_is_set_back() -> None:
    stamps = Stamps()
    second = 10**9
    assert stamps.of(0, 100 * second) == {"sec": 100, "nanosec": 0}
    assert stamps.of(1, 40 * second) == {"sec": 100, "nanosec": 1}
    assert stamps.of(1, 160 * second) == {"sec": 100, "nanosec": 1}, "repeated"
    stamps.forget()
    assert stamps.of(1, 160 * second) == {"sec": 160, "nanosec": 0}
