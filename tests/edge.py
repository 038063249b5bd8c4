"""A cell with a bad line: what it acknowledged reaches the central service once, and in order.

    edge.py PALPATE

A central server with keys, a cell that forwards to it, and a proxy between them that can be cut.
Robots press at the cell while the line is cut, while the cell and the central server are killed,
and while the line breaks in the middle of requests. At the end every acknowledged reading and
retraction must be at the central server, nothing else, and the beliefs must be equal.
"""

import random
import signal
import socket
import sys
import tempfile
import threading
import time
import urllib.error

from nats_servers import Servers, add, palpate, simulated, train_in_a_folder, within

SEED = 7
N_SESSIONS = 6
FETCHED_WITHIN_S = 60
FORWARDED_WITHIN_S = 90


class Line:
    """A TCP proxy to a port that may change, which can be cut, and which breaks connections."""

    def __init__(self):
        self.target, self.is_cut, self.pairs = None, False, []
        self.break_after = None
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.url = f"http://127.0.0.1:{self.listener.getsockname()[1]}"
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            near, _ = self.listener.accept()
            if self.is_cut or self.target is None:
                near.close()
                continue
            try:
                far = socket.create_connection(("127.0.0.1", self.target), timeout=2)
            except OSError:
                near.close()
                continue
            self.pairs.append((near, far))
            for a, b in ((near, far), (far, near)):
                threading.Thread(target=self.pump, args=(a, b), daemon=True).start()

    def pump(self, source, sink):
        try:
            while data := source.recv(65536):
                if self.is_cut:
                    break
                if self.break_after is not None:
                    self.break_after -= len(data)
                    if self.break_after < 0:
                        break
                sink.sendall(data)
        except OSError:
            pass
        for end in (source, sink):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def cut(self):
        self.is_cut = True
        for pair in self.pairs:
            for end in pair:
                try:
                    end.shutdown(socket.SHUT_RDWR)
                except OSError:
                    pass
        self.pairs = []

    def mend(self):
        self.is_cut, self.break_after = False, None


class World:
    """The central server, the cell and the line."""

    def __init__(self, folder, servers):
        self.folder, self.servers, self.line = folder, servers, Line()
        self.acknowledged, self.retracted = {}, {}
        self.start_central()
        with open(self.central.started["admin_key_file"]) as file:
            self.central.key = self.admin = file.read().strip()
        made = self.central.call("POST", "/v1/keys", {"name": "cell-7", "role": "robot"})
        self.key_file = f"{folder}/cell.key"
        with open(self.key_file, "w") as file:
            file.write(made["secret"])
        self.start_cell()

    def start_central(self):
        self.central = self.servers.start("folder", access="keys")
        self.central.key = getattr(self, "admin", None)
        self.line.target = int(self.central.url.rsplit(":", 1)[1])

    def start_cell(self):
        options = ("--forward-to", self.line.url, "--forward-key-file", self.key_file, "--cell", "cell-7")
        self.cell = self.servers.start("cell", *options)

    def kill_central(self):
        self.central.stop(signal.SIGKILL)
        self.start_central()

    def kill_cell(self):
        self.cell.stop(signal.SIGKILL)
        self.start_cell()

    def state(self):
        return self.cell.call("GET", "/v1/forwarding")

    def begin(self, **settings):
        return self.cell.call("POST", "/v1/sessions", {"catalogue": "default", **settings})["id"]

    def press(self, session, readings, pause=lambda number: None):
        """Adds readings at the cell one by one; what is answered is acknowledged."""
        for number, reading in enumerate(readings):
            pause(number)
            for _ in range(100):
                try:
                    add(self.cell, session, [reading])
                    break
                except (OSError, urllib.error.URLError):
                    # Killed: a robot repeats its reading.
                    time.sleep(0.1)
            else:
                sys.exit("the cell never answered")
            self.acknowledged.setdefault(session, []).append(reading)

    def retract(self, session, reading):
        self.cell.call("DELETE", f"/v1/sessions/{session}/readings/{reading['robot']}/{reading['seq']}")
        self.retracted.setdefault(session, []).append((reading["robot"], reading["seq"]))

    def wait_forwarded(self):
        return within(FORWARDED_WITHIN_S, f"nothing waits: {self.state()}", lambda: self.state()["sessions_waiting"] == 0)


def belief(server, session):
    found = server.call("GET", f"/v1/sessions/{session}/belief")
    return {name: value for name, value in found.items() if name != "revision"}


def all_readings(server, session):
    items, cursor = [], ""
    while cursor is not None:
        page = server.call("GET", f"/v1/sessions/{session}/readings?limit=1000{cursor and '&cursor=' + cursor}")
        items += page["items"]
        cursor = page["next_cursor"]
    return items


def compare(world):
    """Every session at the central server against what the robots were told."""
    lost = invented = unequal = 0
    for session, sent in world.acknowledged.items():
        there = all_readings(world.central, session)
        found = [(one["robot"], one["seq"]) for one in there]
        wanted = [(one["robot"], one["seq"]) for one in sent]
        lost += len(set(wanted) - set(found))
        invented += len(found) - len(set(found) & set(wanted))
        gone = {(one["robot"], one["seq"]) for one in there if one["retracted_by"] is not None}
        lost += len(set(world.retracted.get(session, [])) - gone)
        unequal += belief(world.cell, session) != belief(world.central, session)
        here = world.cell.call("GET", f"/v1/sessions/{session}")
        over = world.central.call("GET", f"/v1/sessions/{session}")
        for field in ("state", "labels", "truth", "n_readings", "n_retracted", "revision", "version", "risk"):
            assert here[field] == over[field], (session, field, here[field], over[field])
        assert over["cell"] == "cell-7", over
    n_sent = sum(len(sent) for sent in world.acknowledged.values())
    found = f"acknowledged_lost {lost}, invented {invented}, unequal beliefs {unequal}"
    print(f"{n_sent} readings of {len(world.acknowledged)} sessions: {found}")
    assert lost == invented == unequal == 0


def directly(world, session, readings):
    """The belief of the same readings, sent to the central server without a cell."""
    own = world.central.call("POST", "/v1/sessions", {"catalogue": "default", "risk": 0.05})["id"]
    for reading in readings:
        add(world.central, own, [{**reading, "robot": f"direct-{reading['robot']}"}])
    without = lambda found: {name: value for name, value in found.items() if name != "session"}
    assert without(belief(world.central, own)) == without(belief(world.central, session))


def run(world, readings):
    chance = random.Random(SEED)
    current = lambda: world.state()["catalogues"][0]["current_here"] == 1
    took = within(FETCHED_WITHIN_S, f"the catalogue: {world.state()}", current)
    print(f"the cell has the catalogue after {took:.1f} s")

    online = world.begin(risk=0.05)
    world.press(online, readings)
    took = world.wait_forwarded()
    print(f"the line is up: {len(readings)} readings wait {took:.2f} s after the last one")
    directly(world, online, readings)

    world.line.cut()
    offline = world.begin(labels={"shift": "night"})
    world.press(offline, [{**one, "robot": "left"} for one in readings[:9]])
    # A late reading, taken before the others.
    world.press(offline, [{**readings[9], "robot": "left", "stamp": {"sec": 1, "nanosec": 0}}])
    world.retract(offline, {"robot": "left", "seq": 3})
    world.cell.call("POST", f"/v1/sessions/{offline}/close", {"object": "mug"})
    within(30, "the line is down", lambda: world.state()["down_since"])
    down = world.state()
    assert down["sessions_waiting"] == 1 and down["entries_waiting"] == 11 and down["last_error"], down
    assert "down since" in palpate("forwarding", server=world.cell)
    world.kill_cell()
    assert world.state()["sessions_waiting"] >= 1
    world.line.mend()
    print(f"a session begun and closed offline: forwarded {world.wait_forwarded():.1f} s after the line is back")
    late = world.central.call("PUT", f"/v1/sessions/{offline}/labels", {"labels": {"shift": "night"}})
    assert late["state"] == "closed" and late["truth"]["name"] == "mug", late
    # The truth and labels of a session that is already there.
    world.cell.call("PUT", f"/v1/sessions/{offline}/labels", {"labels": {"shift": "day"}})
    world.wait_forwarded()

    robots, over = [], threading.Event()

    def pause(number):
        # The last readings come after all that happens.
        if number >= len(readings) - 3:
            over.wait()
        time.sleep(0.12 * random.random())

    for number in range(N_SESSIONS):
        session = world.begin()
        own = [{**one, "robot": f"arm-{number}"} for one in readings]
        robots.append(threading.Thread(target=world.press, args=(session, own, pause)))
    for robot in robots:
        robot.start()
    events = [world.line.cut, world.kill_central, world.line.mend, world.kill_cell, world.line.cut, world.kill_cell,
              world.line.mend, world.kill_central]
    for event in events:
        time.sleep(chance.uniform(0.1, 0.6))
        world.line.break_after = chance.randrange(1000, 60000)
        event()
    over.set()
    for robot in robots:
        robot.join()
    world.line.mend()
    print(f"{N_SESSIONS} robots, two kills of each server: forwarded {world.wait_forwarded():.1f} s after the end")
    world.cell.call("POST", f"/v1/sessions/{online}/close")
    world.wait_forwarded()
    compare(world)
    listed = world.central.call("GET", "/v1/sessions?cell=cell-7")["items"]
    assert len(listed) == N_SESSIONS + 2, len(listed)

    # A session on a version that the central server does not have waits, and is named.
    for name in ("mug", "hammer"):
        palpate("objects", "add", name, "--mesh", f"{world.folder}/meshes/{name}.stl", "--unit", "mm", server=world.cell)
    palpate("train", "--catalogue", "own", "--readings-per-object", "60", server=world.cell)
    own = world.begin(catalogue="own")
    add(world.cell, own, [readings[0]])
    within(10, "the refusal", lambda: world.state()["sessions_refused"] == 1)
    [refused] = world.state()["refused"]
    assert refused["session"] == own and "own" in refused["reason"], refused
    print(f"refused, and named: {refused['reason']}")
    # And what becomes current at the central server comes to the cell.
    palpate("train", "--readings-per-object", "60", "--key", world.admin, server=world.central)
    newer = lambda: world.state()["catalogues"][0]["current_here"] == 2
    print(f"a newer version arrived {within(FETCHED_WITHIN_S, 'version 2', newer):.1f} s after its training")


def main():
    begun = time.monotonic()
    with tempfile.TemporaryDirectory(prefix="palpate-edge-") as folder:
        servers = Servers(folder)
        try:
            train_in_a_folder(folder, servers)
            run(World(folder, servers), simulated(folder))
            servers.expect_no_panic()
        except SystemExit:
            for name in ("cell", "folder"):
                print(f"--- {name}:\n" + open(f"{folder}/{name}.log").read()[-3000:], file=sys.stderr)
            raise
        finally:
            servers.close()
    print(f"{time.monotonic() - begun:.0f} s")


if __name__ == "__main__":
    try:
        main()
    except urllib.error.HTTPError as error:
        sys.exit(f"{error.url}: {error.code} {error.read().decode()}")
