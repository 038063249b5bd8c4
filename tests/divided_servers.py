"""Servers of one cluster that divide a catalogue's objects answer as one server with all of them.

    divided_servers.py PALPATE

A folder with a catalogue of 150 small objects, three blocks, is trained and copied to a cluster. A
simulated robot explores a mug on a server of the folder; its readings are then sent to servers that
divide the objects, with one copy of each and with two. Beliefs must be equal bit for bit. A member
that stands still makes the belief partial until its blocks have moved; one that is killed while
others have its objects changes nothing.
"""

import re
import shutil
import signal
import struct
import urllib.request

from nats_servers import (
    add,
    belief,
    cluster,
    new_session,
    palpate,
    simulated,
    within,
)

N_OBJECTS = 150
N_BLOCKS = 3
# A member is gone after 5 s without a word; then another one reads its blocks.
MOVED_WITHIN_S = 60
# Members hear of each other every second.
HEARD_WITHIN_S = 20


def box(width, depth, height):
    """A box in millimetres as a binary STL file."""
    corners = [(x, y, z) for x in (0, width) for y in (0, depth) for z in (0, height)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for a, b, c, d in faces for t in ((a, b, c), (a, c, d))]
    file = bytes(80) + struct.pack("<I", len(triangles))
    for triangle in triangles:
        numbers = [number for corner in triangle for number in corners[corner]]
        file += struct.pack("<3f9fH", 0, 0, 0, *numbers, 0)
    return file


def train(folder, servers):
    """Trains boxes of many sizes, a mug and a hammer on a server of a folder, and stops it."""
    alone = servers.start("folder")
    palpate("objects", "example", "--all", "--out", f"{folder}/meshes")
    names = [f"box-{number}" for number in range(N_OBJECTS - 2)]
    for number, name in enumerate(names):
        file = f"{folder}/box.stl"
        with open(file, "wb") as opened:
            opened.write(box(24 + number % 6 * 5, 26 + number // 6 % 5 * 6, 30 + number // 30 * 7))
        palpate("objects", "add", name, "--mesh", file, "--unit", "mm", server=alone)
    for name in ("mug", "hammer"):
        palpate("objects", "add", name, "--mesh", f"{folder}/meshes/{name}.stl", "--unit", "mm", server=alone)
    wanted = {"readings_per_object": 40, "sva": False, "surface": True, "n_classes": 2}
    job = alone.call("POST", "/v1/catalogues/default/trainings", wanted)["id"]
    state = lambda: alone.call("GET", f"/v1/jobs/{job}")["state"]
    within(600, "the training", lambda: state() in ("succeeded", "failed", "cancelled"))
    assert state() == "succeeded", alone.call("GET", f"/v1/jobs/{job}")
    return alone


def figure(server, name):
    """A figure of a server's metrics."""
    with urllib.request.urlopen(f"{server.url}/metrics", timeout=60) as answer:
        text = answer.read().decode()
    found = re.search(rf"^{re.escape(name)} (\S+)$", text, re.MULTILINE)
    return float(found.group(1)) if found else 0.0


def surface_bytes(server):
    """Bytes of surfaces in a server's memory."""
    return figure(server, 'palpate_model_bytes{part="surface"}')


def held(server):
    """The blocks that a server says it holds itself."""
    own = server.call("GET", "/v1/members")["members"][0]
    assert own["is_self"], own
    return sum(version["n_held"] for version in own["blocks"])


def n_members(server):
    """Number of members that a server knows, itself included."""
    return len(server.call("GET", "/v1/members")["members"])


def played(servers, readings):
    """The belief after readings that were sent to servers in turn."""
    session = new_session(servers[0])
    for number, reading in enumerate(readings):
        add(servers[number % len(servers)], session, [reading])
    known = lambda: belief(servers[0], session)["n_readings"]
    within(10, "all readings", lambda: known() == len(readings))
    return session, seen(servers[0], session)


def seen(server, session):
    """The belief of a session, and where to touch next."""
    asking = {"sensor": "digitacts-6x6", "deadline_ms": 10_000}
    asked = server.call("POST", f"/v1/sessions/{session}/next-touches", asking)
    assert asked["complete"], "next touches were not all evaluated"
    touches = {name: asked[name] for name in ("touches", "entropy_bits")}
    return {**belief(server, session), "next": touches}


def start_pair(start):
    """Two servers that both hold blocks: which ones is a matter of their ids."""
    for attempt in range(12):
        pair = [start(f"{name}-{attempt}", "1") for name in ("first", "second")]
        within(HEARD_WITHIN_S, "two members", lambda: all(n_members(it) == 2 for it in pair))
        new_session(pair[0])
        settled = lambda: sum(held(it) for it in pair) == N_BLOCKS
        within(MOVED_WITHIN_S, "each block on one member", settled)
        if all(held(it) > 0 for it in pair):
            return pair
        for server in pair:
            server.stop()
    raise SystemExit("one of two members got all blocks, twelve times")


def one_copy(start, readings, expected, whole_bytes):
    """Two servers with one copy: equal beliefs, less memory, and what happens without one."""
    first, second = start_pair(start)
    _, found = played((first, second), readings)
    assert found == expected, "one copy on two servers: another belief"
    both = [surface_bytes(it) for it in (first, second)]
    # One may hold most blocks by its id, and reads maps of the others for next touches.
    assert 0 < min(both) < 0.9 * whole_bytes, (both, whole_bytes)
    print(f"one copy on two servers: equal beliefs, {both} of {whole_bytes} bytes of surfaces")

    second.process.send_signal(signal.SIGSTOP)
    session, found = played((first,), readings)
    assert found["partial"], "a member stands still, and the belief says nothing"
    n_missing = found["n_missing_objects"]
    names = {it["name"] for it in found["missing_objects"]}
    assert 0 < n_missing < N_OBJECTS and len(names) == min(n_missing, 100), n_missing
    lost = {it["name"] for it in found["objects"] if it["probability"] == 0}
    assert names <= lost, "a missing object has a probability"
    assert figure(first, "palpate_beliefs_partial_total") > 0
    took = within(MOVED_WITHIN_S, "a whole belief", lambda: "partial" not in belief(first, session))
    assert seen(first, session) == expected, "after blocks have moved: another belief"
    assert held(first) == N_BLOCKS, held(first)
    print(f"a member stood still: {n_missing} objects missing, whole again {took:.1f} s later")
    second.process.send_signal(signal.SIGCONT)
    within(HEARD_WITHIN_S, "its return", lambda: n_members(first) == 2)
    within(MOVED_WITHIN_S, "its blocks", lambda: held(first) + held(second) == N_BLOCKS)
    _, found = played((first, second), readings)
    assert found == expected, "after a return: another belief"

    second.stop(signal.SIGKILL)
    _, found = played((first,), readings)
    within(MOVED_WITHIN_S, "all blocks", lambda: held(first) == N_BLOCKS)
    _, found = played((first,), readings)
    assert found == expected, "after a death: another belief"
    first.stop()
    print("a killed member's blocks moved to the other: equal beliefs")


def two_copies(start, readings, expected):
    """Three servers with two copies: the loss of one changes nothing."""
    all_three = [start(name, "2") for name in ("third", "fourth", "fifth")]
    within(HEARD_WITHIN_S, "three members", lambda: all(n_members(it) == 3 for it in all_three))
    _, found = played(all_three, readings)
    assert found == expected, "two copies on three servers: another belief"
    n_held = lambda servers: sum(held(it) for it in servers)
    within(MOVED_WITHIN_S, "two copies", lambda: n_held(all_three) == 2 * N_BLOCKS)
    most = max(all_three, key=held)
    left = [it for it in all_three if it is not most]
    session = new_session(left[0])
    for number, reading in enumerate(readings):
        if number == len(readings) // 2:
            most.stop(signal.SIGKILL)
        answer = add(left[number % 2], session, [reading])
        assert "partial" not in (answer.get("belief") or {}), "a belief is partial with two copies"
    known = lambda: belief(left[0], session)["n_readings"]
    within(10, "all readings", lambda: known() == len(readings))
    assert seen(left[0], session) == expected, "after a death with two copies: another belief"
    within(MOVED_WITHIN_S, "two copies again", lambda: n_held(left) == 2 * N_BLOCKS)
    print("two copies on three servers, one of them killed: equal and whole beliefs")
    within(HEARD_WITHIN_S, "two members", lambda: n_members(left[0]) == 2)
    shown = palpate("members", server=left[0])
    assert "2 servers, 2 copies" in shown and "3 of 3" in shown, shown
    for server in left:
        server.stop()


def main():
    with cluster() as (folder, address, servers):
        alone = train(folder, servers)
        # All of them, so that few objects stay likely: next touches follow from at most 128.
        readings = simulated(folder)
        session = new_session(alone)
        for reading in readings:
            add(alone, session, [reading])
        expected, whole_bytes = seen(alone, session), surface_bytes(alone)
        assert len(expected["objects"]) == N_OBJECTS, len(expected["objects"])
        alone.stop()
        print(palpate("copy", "--from", f"sled:{folder}/folder", "--to", address).strip())
        shared = ("--store", address, "--store-shared")
        start = lambda name, copies: servers.start(name, *shared, "--divide-copies", copies)
        one_copy(start, readings, expected, whole_bytes)
        two_copies(start, readings, expected)
        servers.expect_no_panic()
        shutil.rmtree(f"{folder}/meshes")


if __name__ == "__main__":
    main()
