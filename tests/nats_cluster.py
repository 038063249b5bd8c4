"""Runs a cluster of NATS servers on loopback, for tests.

Prints the servers' addresses on one line when the cluster is ready. Reads commands: `kill N` and
`start N`, each answered with a line. Ends, and takes everything with it, when its input ends.
The program is in PALPATE_NATS_SERVER. `nats_cluster.py 1` runs one server without a cluster.
"""

import json
import os
import shutil
import signal
import socket
import subprocess
import sys
import tempfile
import time

PROGRAM = os.environ["PALPATE_NATS_SERVER"]
READY_WITHIN_S = 300


def free_ports(number):
    """Ports of loopback that nobody uses."""
    sockets = [socket.socket() for _ in range(number)]
    for one in sockets:
        one.bind(("127.0.0.1", 0))
    ports = [one.getsockname()[1] for one in sockets]
    for one in sockets:
        one.close()
    return ports


class Cluster:
    """Servers with their folder."""

    def __init__(self, size):
        self.folder = tempfile.mkdtemp(prefix="palpate-nats-")
        ports = free_ports(3 * size)
        self.clients, self.routes, self.monitors = ports[:size], ports[size : 2 * size], ports[2 * size :]
        self.processes = [None] * size
        for number in range(size):
            self.configure(number)
            self.start(number)

    def configure(self, number):
        routes = ", ".join(f"nats://127.0.0.1:{port}" for port in self.routes)
        cluster = f"cluster {{ name: test, listen: 127.0.0.1:{self.routes[number]}, routes: [{routes}] }}"
        text = f"""
            server_name: n{number}
            listen: 127.0.0.1:{self.clients[number]}
            http: 127.0.0.1:{self.monitors[number]}
            jetstream {{ store_dir: "{self.folder}/n{number}", sync_interval: always,
                         max_mem: 64MB, max_file: 8GB }}
            {cluster if len(self.processes) > 1 else ""}
        """
        with open(f"{self.folder}/n{number}.conf", "w") as file:
            file.write(text)

    def start(self, number):
        command = [PROGRAM, "-c", f"{self.folder}/n{number}.conf", "-l", f"{self.folder}/n{number}.log"]
        self.processes[number] = subprocess.Popen(command, stdin=subprocess.DEVNULL)
        self.wait(number)

    def kill(self, number):
        self.processes[number].send_signal(signal.SIGKILL)
        self.processes[number].wait()

    def wait(self, number):
        """Waits until a server answers, and its JetStream has a leader."""
        import urllib.request

        until = time.monotonic() + READY_WITHIN_S
        path = "healthz" if all(self.processes) else "varz"
        while time.monotonic() < until:
            try:
                url = f"http://127.0.0.1:{self.monitors[number]}/{path}"
                with urllib.request.urlopen(url, timeout=1) as answer:
                    json.load(answer)
                    return
            except OSError:
                time.sleep(0.05)
        raise SystemExit(f"server {number} is not ready after {READY_WITHIN_S} s")

    def close(self):
        for process in self.processes:
            if process and process.poll() is None:
                process.kill()
                process.wait()
        shutil.rmtree(self.folder, ignore_errors=True)


def main():
    """Runs until the input ends."""
    cluster = Cluster(int(sys.argv[1]) if len(sys.argv) > 1 else 3)
    try:
        for number in range(len(cluster.processes)):
            cluster.wait(number)
        hosts = ",".join(f"127.0.0.1:{port}" for port in cluster.clients)
        print(f"nats://{hosts}", flush=True)
        for line in sys.stdin:
            command, number = line.split()
            {"kill": cluster.kill, "start": cluster.start}[command](int(number))
            print("done", flush=True)
    finally:
        cluster.close()


if __name__ == "__main__":
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(1))
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    main()
