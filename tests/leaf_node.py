"""What a NATS leaf node does for Palpate, and what not.

    leaf_node.py PALPATE

A hub with JetStream, a leaf node without, and a server of ours that stores through the leaf node.
It works like one at the hub. While the leaf node's link is cut nothing is acknowledged; what was
acknowledged before is there afterwards, and the server goes on by itself.
"""

import os
import subprocess
import sys
import tempfile
import threading
import time
import urllib.error

from edge import Line
from nats_cluster import free_ports
from nats_servers import Servers, add, belief, new_session, palpate, simulated, train_in_a_folder, within

PROGRAM = os.environ["PALPATE_NATS_SERVER"]
CUT_S = 5
GOES_ON_WITHIN_S = 600


def start(folder, name, port, text):
    """A NATS server on a port of loopback."""
    file = f"{folder}/{name}.conf"
    with open(file, "w") as opened:
        opened.write(f"server_name: {name}\nlisten: 127.0.0.1:{port}\n{text}\n")
    return subprocess.Popen([PROGRAM, "-c", file, "-l", f"{folder}/{name}.log"], stdin=subprocess.DEVNULL)


def run(folder, servers, processes):
    train_in_a_folder(folder, servers)
    readings = simulated(folder)
    hub, leaf, link = free_ports(3)
    line = Line()
    line.target = link
    jetstream = f'store_dir: "{folder}/hub", domain: hub, sync_interval: always, max_mem: 64MB, max_file: 8GB'
    accounts = """
        accounts {{ A {{ {}, users: [{{ user: a, password: a }}] }}, SYS {{ users: [{{ user: s, password: s }}] }} }}
        system_account: SYS
        no_auth_user: a
    """
    text = f"jetstream {{ {jetstream} }}\nleafnodes {{ listen: 127.0.0.1:{link}, no_advertise: true }}"
    processes.append(start(folder, "hub", hub, accounts.format("jetstream: enabled") + text))
    remote = line.url.replace("http://", "nats-leaf://a:a@")
    text = f'leafnodes {{ reconnect: "1s", remotes: [{{ url: "{remote}", account: A }}] }}'
    # The hub's JetStream has a domain, by which the leaf node reaches it.
    mapped = 'mappings: { "$JS.API.>": "$JS.hub.API.>" }'
    processes.append(start(folder, "leaf", leaf, accounts.format(mapped) + text))
    time.sleep(2)
    palpate("copy", "--from", f"sled:{folder}/folder", "--to", f"nats://127.0.0.1:{hub}")
    shared = "--store-shared"
    here = servers.start("at-the-leaf", "--store", f"nats://127.0.0.1:{leaf}", shared)
    there = servers.start("at-the-hub", "--store", f"nats://127.0.0.1:{hub}", shared)
    session = new_session(here)
    half = len(readings) // 2
    for reading in readings[:half]:
        add(here, session, [reading])
    known = lambda: belief(there, session)["n_readings"] == belief(here, session)["n_readings"]
    within(5, "the readings at the hub", known)
    assert belief(here, session) == belief(there, session)
    print(f"through the leaf node: {half} readings, equal beliefs at the hub")

    line.cut()
    answered = []

    def press():
        for reading in readings[half:]:
            while True:
                try:
                    add(here, session, [reading])
                    break
                except (SystemExit, OSError, urllib.error.URLError):
                    time.sleep(0.2)
            answered.append(time.monotonic())

    robot = threading.Thread(target=press, daemon=True)
    robot.start()
    time.sleep(CUT_S)
    assert not answered, f"{len(answered)} readings were acknowledged while the link was cut"
    line.mend()
    mended = time.monotonic()
    robot.join(GOES_ON_WITHIN_S)
    assert not robot.is_alive(), f"{len(answered)} of {len(readings) - half} readings after {GOES_ON_WITHIN_S} s"
    print(f"cut for {CUT_S} s: none acknowledged; the first one {answered[0] - mended:.1f} s after the end")
    known = lambda: belief(there, session)["n_readings"] == belief(here, session)["n_readings"]
    within(10, "the readings at the hub", known)
    assert belief(here, session) == belief(there, session)
    print("nothing lost, equal beliefs")
    servers.expect_no_panic()


def main():
    with tempfile.TemporaryDirectory(prefix="palpate-leaf-") as folder:
        servers, processes = Servers(folder), []
        try:
            run(folder, servers, processes)
        finally:
            servers.close()
            for process in processes:
                process.kill()
                process.wait()


if __name__ == "__main__":
    try:
        main()
    except urllib.error.HTTPError as error:
        sys.exit(f"{error.url}: {error.code} {error.read().decode()}")
