"""Two Palpate servers on one NATS cluster answer as one server on a folder does.

    two_servers.py PALPATE

A folder with a trained catalogue is copied to the cluster, and back. A simulated robot explores an
object on a server of the folder; its readings are then sent through two servers of the cluster, in
turn and at the same time, with a crash of one of them. The beliefs must be equal. Snapshots of the
cluster go to an object store and come back.
"""

import json
import signal
import threading
import time

from nats_servers import (
    N_READINGS,
    add,
    belief,
    cluster,
    new_session,
    palpate,
    simulated,
    train_in_a_folder,
    within,
)


def main():
    with cluster() as (folder, address, servers):
        run(folder, address, servers)


def settled(server, session, n_readings):
    """The belief of a server that knows all readings: it hears of another one's a moment later."""
    known = lambda: belief(server, session)["n_readings"] == n_readings
    within(1, f"{n_readings} readings", known)
    return belief(server, session)


def run(folder, address, servers):
    start = servers.start
    train_in_a_folder(folder, servers)
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
        known = settled(server, session, expected["n_readings"])
        assert known == expected, "readings in turn: another belief"
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
    found = [settled(server, together, expected["n_readings"]) for server in (first, second)]
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
    snapshots(f"{address}/backup", folder, second)
    servers.expect_no_panic()


def snapshots(place, folder, server):
    """Snapshots of a server on the cluster, in an object store of the same cluster."""
    names = []
    for _ in range(3):
        answer = json.loads(palpate("snapshot", "backup", place, "--keep", "2", "--json", server=server))
        names.append(answer["name"])
        time.sleep(1.1)
    listed = json.loads(palpate("snapshot", "list", place, "--json"))
    assert [one["name"] for one in listed] == names[1:], listed
    assert answer["removed"] == names[:1] and answer["kept"] == names[1:], answer
    verified = palpate("snapshot", "verify", f"{place}/{names[2]}")
    assert "0 damaged" in verified, verified
    palpate("snapshot", "restore", f"{place}/{names[2]}", "--data", f"{folder}/restored")
    checked = palpate("fsck", "--data", f"{folder}/restored")
    print(f"snapshots in an object store: {verified.strip()}; restored: {checked.strip()}")


if __name__ == "__main__":
    main()
