"""Two Palpate servers on one NATS cluster answer as one server on a folder does.

    two_servers.py PALPATE

A folder with a trained catalogue is copied to the cluster, and back. A simulated robot explores an
object on a server of the folder; its readings are then sent through two servers of the cluster, in
turn and at the same time, with a crash of one of them. The beliefs must be equal.
"""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error
import urllib.request

PALPATE = sys.argv[1]
HERE = os.path.dirname(os.path.abspath(__file__))
N_READINGS = 24
REPETITIONS_MAX = 40


class Server:
    """A running `palpate serve`."""

    def __init__(self, folder, name, *arguments):
        self.log = open(f"{folder}/{name}.log", "a")
        command = [PALPATE, "serve", "--listen", "127.0.0.1:0", "--access", "open", "--json"]
        command += ["--data", f"{folder}/{name}", *arguments]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=self.log)
        started = self.process.stdout.readline()
        if not started:
            sys.exit(f"{name} did not start:\n{open(self.log.name).read()}")
        self.url = json.loads(started)["server"]

    def call(self, method, path, body=None):
        """The answer of a request; an error of the server's ends the test."""
        data = None if body is None else json.dumps(body).encode()
        headers = {"content-type": "application/json"}
        request = urllib.request.Request(self.url + path, data, headers, method=method)
        with urllib.request.urlopen(request, timeout=60) as answer:
            return json.loads(answer.read() or b"null")

    def stop(self, how=signal.SIGTERM):
        self.process.send_signal(how)
        self.process.wait()


def palpate(*arguments, server=None):
    """Runs a command; returns what it prints."""
    environment = {**os.environ, **({"PALPATE_SERVER": server.url} if server else {})}
    done = subprocess.run([PALPATE, *arguments], env=environment, capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"palpate {' '.join(arguments)}: {done.stdout}{done.stderr}")
    return done.stdout


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


def main():
    with tempfile.TemporaryDirectory(prefix="palpate-two-") as folder:
        cluster = subprocess.Popen(
            [sys.executable, f"{HERE}/nats_cluster.py", "3"],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        servers = []
        try:
            run(folder, cluster.stdout.readline().strip(), servers)
        finally:
            for server in servers:
                if server.process.poll() is None:
                    server.process.kill()
                    server.process.wait()
            cluster.stdin.close()
            cluster.wait()


def run(folder, address, servers):
    def start(name, *arguments):
        servers.append(Server(folder, name, *arguments))
        return servers[-1]

    alone = start("folder")
    palpate("objects", "example", "--all", "--out", f"{folder}/meshes")
    for name in ("mug", "hammer"):
        palpate("objects", "add", name, "--mesh", f"{folder}/meshes/{name}.stl", server=alone)
    palpate("train", "--readings-per-object", "60", server=alone)
    alone.stop()
    begun = time.monotonic()
    copied = palpate("copy", "--from", f"sled:{folder}/folder", "--to", address)
    print(f"to the cluster in {time.monotonic() - begun:.1f} s: {copied.strip()}")
    begun = time.monotonic()
    back = palpate("copy", "--from", address, "--to", f"sled:{folder}/back")
    print(f"and back in {time.monotonic() - begun:.1f} s: {back.strip()}")
    assert copied == back, (copied, back)

    alone = start("folder")
    readings = simulated(folder)
    expected_session = new_session(alone)
    for reading in readings:
        add(alone, expected_session, [reading])
    expected = belief(alone, expected_session)

    shared = ("--store", address, "--store-shared")
    first, second = start("first", *shared), start("second", *shared)
    session = new_session(first)
    for number, reading in enumerate(readings):
        add((first, second)[number % 2], session, [reading])
    for server in (first, second):
        assert belief(server, session) == expected, "readings in turn: another belief"
    print(f"{len(readings)} readings in turn: equal beliefs")

    together = new_session(second)
    halves = [(first, readings[0::2]), (second, readings[1::2])]
    threads = [
        threading.Thread(target=lambda s=server, r=half: [add(s, together, [one]) for one in r])
        for server, half in halves
    ]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    found = [belief(server, together) for server in (first, second)]
    assert found[0] == found[1], "readings at the same time: the servers differ"
    assert found[0]["n_readings"] == expected["n_readings"], found[0]["n_readings"]
    print(f"{len(readings)} readings at the same time: both servers have one belief")

    crossed = new_session(first)
    for reading in readings[: N_READINGS // 2]:
        add(first, crossed, [reading])
    first.stop(signal.SIGKILL)
    # The last one was acknowledged by the dead server.
    repeated = add(second, crossed, [readings[N_READINGS // 2 - 1]])
    assert repeated["n_repeated"] == 1, repeated
    for reading in readings[N_READINGS // 2 :]:
        add(second, crossed, [reading])
    assert belief(second, crossed) == expected, "after a crash: another belief"
    print("a killed server's session went on with the other one: equal beliefs")
    for server in servers:
        log = open(server.log.name).read()
        assert not re.search("panicked", log), log


def simulated(folder):
    """Readings of a simulated robot that explores a mug."""
    file = f"{folder}/readings.json"
    palpate("explore", "--object", "mug", "--readings", str(N_READINGS), "--offline", "--out", file)
    with open(file) as opened:
        readings = json.load(opened)["readings"]
    return [{**reading, "robot": "arm", "seq": number} for number, reading in enumerate(readings)]


if __name__ == "__main__":
    main()
