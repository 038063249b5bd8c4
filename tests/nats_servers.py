"""Real `palpate serve` processes on a cluster of NATS servers, for the tests of several servers."""

import contextlib
import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
import urllib.error
import urllib.request

HERE = os.path.dirname(os.path.abspath(__file__))
PALPATE = sys.argv[1]
REPETITIONS_MAX = 40
N_READINGS = 24


class Server:
    """A running `palpate serve`. `key` is sent with every request."""

    def __init__(self, folder, name, *arguments, access="open", key=None):
        self.log = open(f"{folder}/{name}.log", "a")
        command = [PALPATE, "serve", "--listen", "127.0.0.1:0", "--access", access, "--json"]
        command += ["--data", f"{folder}/{name}", *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self.log)
        started = self.process.stdout.readline()
        if not started:
            sys.exit(f"{name} did not start:\n{open(self.log.name).read()}")
        self.started = json.loads(started)
        self.url, self.key = self.started["server"], key

    def request(self, method, path, body=None, key=None, **headers):
        data = None if body is None else json.dumps(body).encode()
        headers["content-type"] = "application/json"
        if key or self.key:
            headers["authorization"] = f"Bearer {key or self.key}"
        return urllib.request.Request(self.url + path, data, headers, method=method)

    def call(self, method, path, body=None, key=None, **headers):
        """The answer of a request; a status of an error is raised."""
        request = self.request(method, path, body, key, **headers)
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.loads(answer.read() or b"null")

    def status(self, method, path, body=None, key=None):
        """The status of a request."""
        try:
            with urllib.request.urlopen(self.request(method, path, body, key), timeout=60) as answer:
                return answer.status
        except urllib.error.HTTPError as error:
            return error.code

    def stop(self, how=signal.SIGTERM):
        self.process.send_signal(how)
        self.process.wait()


class Servers:
    """The servers of a test, which end with it."""

    def __init__(self, folder):
        self.folder, self.all = folder, []

    def start(self, name, *arguments, **how):
        self.all.append(Server(self.folder, name, *arguments, **how))
        return self.all[-1]

    def close(self):
        for server in self.all:
            if server.process.poll() is None:
                server.process.kill()
                server.process.wait()

    def expect_no_panic(self):
        for server in self.all:
            log = open(server.log.name).read()
            assert not re.search("panicked", log), log


@contextlib.contextmanager
def cluster():
    """A folder, an address of three NATS servers, and servers to start."""
    with tempfile.TemporaryDirectory(prefix="palpate-servers-") as folder:
        command = [sys.executable, f"{HERE}/nats_cluster.py", "3"]
        process = subprocess.Popen(
            command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
        )
        servers = Servers(folder)
        try:
            yield folder, process.stdout.readline().strip(), servers
        finally:
            servers.close()
            process.stdin.close()
            process.wait()


def palpate(*arguments, server=None):
    """Runs a command; returns what it prints."""
    environment = {**os.environ, **({"PALPATE_SERVER": server.url} if server else {})}
    done = subprocess.run([PALPATE, *arguments], env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"palpate {' '.join(arguments)}: {done.stdout}{done.stderr}")
    return done.stdout


def train_in_a_folder(folder, servers):
    """Trains a mug and a hammer on a server of a folder, `folder/folder`, and stops it."""
    alone = servers.start("folder")
    palpate("objects", "example", "--all", "--out", f"{folder}/meshes")
    for name in ("mug", "hammer"):
        palpate("objects", "add", name, "--mesh", f"{folder}/meshes/{name}.stl", "--unit", "mm", server=alone)
    palpate("train", "--readings-per-object", "60", server=alone)
    alone.stop()


def new_session(server):
    return server.call("POST", "/v1/sessions", {"catalogue": "default"})["id"]


def belief(server, session):
    """A session's belief without what names the session."""
    found = server.call("GET", f"/v1/sessions/{session}/belief")
    return {name: value for name, value in found.items() if name != "session"}


def add(server, session, readings):
    """Adds readings, and again as long as the server has no answer, as robots do."""
    for _ in range(REPETITIONS_MAX):
        try:
            return server.call("POST", f"/v1/sessions/{session}/readings", {"readings": readings})
        except urllib.error.HTTPError as error:
            if error.code not in (429, 503):
                sys.exit(f"{error.code}: {error.read().decode()}")
            time.sleep(0.05)
    sys.exit("a reading was refused each time")


def simulated(folder):
    """Readings of a simulated robot that explores a mug."""
    file = f"{folder}/readings.json"
    palpate("explore", "--object", "mug", "--readings", str(N_READINGS), "--offline", "--out", file)
    with open(file) as opened:
        readings = json.load(opened)["readings"]
    return [{**reading, "robot": "arm", "seq": number} for number, reading in enumerate(readings)]


# The limits are for a usual machine. They only end a test that hangs, so they are taken this often.
PATIENCE = 10


def within(seconds, what, holds):
    """Waits until something holds; returns the seconds that it took."""
    begun = time.monotonic()
    while True:
        found = holds()
        took = time.monotonic() - begun
        if found:
            return took
        if took > PATIENCE * seconds:
            sys.exit(f"not within {PATIENCE * seconds} s: {what}")
        time.sleep(0.02)
