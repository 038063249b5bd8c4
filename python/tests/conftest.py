"""A real server with data of its own, and what several tests train from."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import time
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

import palpate
from palpate import local
from palpate.local import Mesh, Sensor

STARTED_S_MAX = 300


@dataclass
class Server:
    """A running server."""

    command: str
    data: Path
    listen: str = "127.0.0.1:0"
    address: str = ""
    process: subprocess.Popen[bytes] | None = None

    def start(self) -> None:
        """Starts it and waits until it answers."""
        out = self.data.parent / "started"
        with out.open("wb") as started, (self.data.parent / "log").open("ab") as log:
            self.process = subprocess.Popen(
                [
                    self.command,
                    "serve",
                    "--listen",
                    self.listen,
                    "--data",
                    str(self.data),
                    "--json",
                ],
                stdout=started,
                stderr=log,
            )
        deadline = time.monotonic() + STARTED_S_MAX
        while not out.read_bytes().strip():
            assert self.process.poll() is None, (self.data.parent / "log").read_text()
            assert time.monotonic() < deadline, "the server did not start"
            time.sleep(0.05)
        self.address = json.loads(out.read_text())["server"]
        # A restart listens where clients expect it.
        self.listen = self.address.removeprefix("http://")

    def stop(self, how: signal.Signals = signal.SIGTERM) -> None:
        """Stops it and waits for its end."""
        if self.process is not None:
            self.process.send_signal(how)
            self.process.wait(30)
            self.process = None


def command() -> str:
    """The server's binary, which `tests/python` names."""
    found = os.environ.get("PALPATE_COMMAND")
    if not found:
        pytest.fail("PALPATE_COMMAND is not set: name the built `palpate`, or run tests/python")
    return found


@pytest.fixture(scope="session")
def server(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Server]:
    running = Server(command(), tmp_path_factory.mktemp("server") / "data")
    running.start()
    yield running
    running.stop()
    log = (running.data.parent / "log").read_text()
    assert "panicked" not in log, log


@pytest.fixture
def own_server(tmp_path: Path) -> Iterator[Server]:
    running = Server(command(), tmp_path / "data")
    running.start()
    yield running
    running.stop()


@pytest.fixture
def client(server: Server) -> Iterator[palpate.Client]:
    with palpate.Client(server.address) as connected:
        yield connected


@pytest.fixture(scope="session")
def sensor() -> Sensor:
    return Sensor.preset("digitacts-6x6")


@pytest.fixture(scope="session")
def meshes() -> dict[str, Mesh]:
    return {name: Mesh.example(name) for name in ("mug", "hammer")}


@pytest.fixture(scope="session")
def taught(meshes: dict[str, Mesh], sensor: Sensor) -> dict[str, palpate.Readings]:
    """Readings for training, of each object."""
    return {
        name: local.touch(mesh, sensor, 200, seed=40 + index)
        for index, (name, mesh) in enumerate(meshes.items())
    }


@pytest.fixture(scope="session")
def felt(meshes: dict[str, Mesh], sensor: Sensor) -> palpate.Readings:
    """Touches of a mug that stands somewhere else."""
    moved = ([0.1, -0.2, 0.3, 0.9273618495495704], [0.4, -0.1, 0.25])
    return local.touch(meshes["mug"], sensor, 12, seed=77).moved(moved)


@pytest.fixture(scope="session")
def trained(server: Server, taught: dict[str, palpate.Readings]) -> str:
    """A catalogue that knows the mug and the hammer."""
    with palpate.Client(server.address) as client:
        for name, readings in taught.items():
            client.create_object(f"{name}-client")
            client.add_training_readings(
                f"{name}-client", "digitacts-6x6", readings, robot="teacher"
            )
        names = [f"{name}-client" for name in taught]
        client.train("client", objects=names, sva=False, surface=True)
    return "client"
