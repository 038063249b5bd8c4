"""Several Palpate servers on one NATS cluster are one service: what one changes, all know.

    one_service.py PALPATE

Two servers with API keys: keys made and revoked on either, at the same time too; switches of
catalogues and labels; lists of sessions; one audit log; followers of a session whose readings the
other server takes; a training whose server is killed, and the webhooks that only that server sent.
"""

import collections
import http.server
import json
import signal
import sys
import threading
import urllib.error

from nats_servers import (
    add,
    cluster,
    new_session,
    palpate,
    simulated,
    train_in_a_folder,
    within,
)

# A server hears of a change within this many seconds.
HEARD_WITHIN_S = 1.0
# A right of a server that died is free after 20 s; its successor looks every 2 s.
TAKEN_OVER_WITHIN_S = 30


class Receiver:
    """Counts the events that webhooks deliver."""

    def __init__(self):
        self.events = events = []

        class Handler(http.server.BaseHTTPRequestHandler):
            def do_POST(self):
                events.append(json.loads(self.rfile.read(int(self.headers["content-length"]))))
                self.send_response(204)
                self.end_headers()

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        threading.Thread(target=self.server.serve_forever, daemon=True).start()
        self.url = f"http://127.0.0.1:{self.server.server_address[1]}/"

    def of_type(self, kind):
        return [event for event in self.events if event["type"] == kind]


class Follower:
    """Follows the events of a session or a job."""

    def __init__(self, server, path):
        import urllib.request

        self.events = []
        self.stream = urllib.request.urlopen(server.request("GET", path), timeout=120)
        threading.Thread(target=self.read, daemon=True).start()

    def read(self):
        try:
            for line in self.stream:
                if line.startswith(b"data:"):
                    self.events.append(json.loads(line[5:]))
        except OSError:
            pass


def together(*calls):
    """What calls return that are made at the same time."""
    found = [None] * len(calls)

    def make(number):
        found[number] = calls[number]()

    threads = [threading.Thread(target=make, args=(number,)) for number in range(len(calls))]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    return found


def keys(first, second):
    """Keys made and revoked on either server."""
    made = first.call("POST", "/v1/keys", {"name": "viewer", "role": "viewer"})
    visit = lambda server: server.status("GET", "/v1/sessions", key=made["secret"])
    took = within(HEARD_WITHIN_S, "a new key", lambda: visit(second) == 200)
    second.call("DELETE", "/v1/keys/viewer")
    gone = within(HEARD_WITHIN_S, "a revoked key", lambda: visit(first) == 401)
    new = {"name": "twin", "role": "robot"}
    found = together(*[lambda s=s: s.status("POST", "/v1/keys", new) for s in (first, second)])
    assert sorted(found) == [201, 409], f"one name twice: {found}"
    # Of two admin keys, one must be left.
    first.call("POST", "/v1/keys", {"name": "other", "role": "admin"})
    within(HEARD_WITHIN_S, "a key", lambda: second.status("GET", "/v1/keys/other") == 200)
    admin = [key["name"] for key in first.call("GET", "/v1/keys")["items"] if key["role"] == "admin"]
    assert len(admin) == 2, admin
    spare = first.call("POST", "/v1/keys/other/rotate", {})["secret"]
    within(HEARD_WITHIN_S, "a rotation", lambda: second.status("GET", "/v1/keys", key=spare) == 200)
    found = together(
        lambda: first.status("DELETE", "/v1/keys/other"),
        lambda: second.status("DELETE", f"/v1/keys/{admin[0] if admin[0] != 'other' else admin[1]}", key=spare),
    )
    assert sorted(found) == [204, 409], f"no admin key is left, or both: {found}"
    if found[1] == 204:
        first.key = second.key = spare
    print(f"keys: heard after {took:.3f} s, refused after {gone:.3f} s; one of two equal names, one admin left")


def switches(first, second):
    """A version, labels and a session, each changed on one server and read from the other."""
    job = first.call("POST", "/v1/catalogues/default/trainings", {"readings_per_object": 60, "activate": False})
    state = lambda server: server.call("GET", f"/v1/jobs/{job['id']}")["state"]
    within(240, "a training", lambda: state(second) == "succeeded")
    current = first.call("GET", "/v1/catalogues/default")
    assert current["current"]["version"] == 1, current
    request = first.request("GET", "/v1/catalogues/default/current")
    import urllib.request

    tag = urllib.request.urlopen(request).headers["etag"]
    first.call("PUT", "/v1/catalogues/default/current", {"version": 2}, **{"if-match": tag})
    begun = lambda: second.call("POST", "/v1/sessions", {"catalogue": "default"})["version"]
    took = within(HEARD_WITHIN_S, "a switch", lambda: begun() == 2)
    second.call("GET", "/v1/sensors/digitacts-6x6")
    first.call("PUT", "/v1/sensors/digitacts-6x6/labels", {"labels": {"cell": "7"}})
    labels = lambda: second.call("GET", "/v1/sensors/digitacts-6x6")["labels"]
    within(HEARD_WITHIN_S, "a label", lambda: labels() == {"cell": "7"})
    session = new_session(first)
    newest = lambda: second.call("GET", "/v1/sessions?order=newest&limit=1")["items"][0]["id"]
    within(HEARD_WITHIN_S, "a session", lambda: newest() == session)
    second.call("DELETE", f"/v1/sessions/{session}")
    within(HEARD_WITHIN_S, "a deletion", lambda: first.status("GET", f"/v1/sessions/{session}") == 404)
    assert session not in [one["id"] for one in first.call("GET", "/v1/sessions?order=newest")["items"]]
    print(f"a switch of the catalogue was heard after {took:.3f} s; labels and sessions as well")


def audit(first, second):
    """Changes on both servers at the same time are all in one log."""
    each = 25

    def change(server):
        for _ in range(each):
            new_session(server)
            assert server.status("DELETE", "/v1/keys/nobody") == 404

    before = len(log(first))
    together(*[lambda s=server: change(s) for server in (first, second) for _ in range(2)])
    within(HEARD_WITHIN_S, "the same log", lambda: log(first) == log(second))
    found = log(second)
    numbers = [entry["seq"] for entry in found]
    assert numbers == sorted(set(numbers), reverse=True), "a number came twice"
    new = found[: len(found) - before]
    made = [entry["resource"] for entry in new if entry["operation"] == "create_session"]
    assert len(set(made)) == 4 * each, f"{len(set(made))} of {4 * each} entries"
    # 2026-01-02T03:04:05.678Z, where zeros at the end of the fraction are left out.
    times = [(entry["at"][:19], float("0" + entry["at"][19:-1])) for entry in found]
    assert times == sorted(times, reverse=True), "times decrease"
    print(f"audit: {len(made)} changes of two servers in one order, none lost")


def log(server):
    entries, cursor = [], ""
    while cursor is not None:
        page = server.call("GET", f"/v1/audit?limit=200{cursor and '&cursor=' + cursor}")
        entries += page["items"]
        cursor = page.get("next_cursor")
    return entries


def followers(first, second, readings):
    """A follower on one server receives what the other one does."""
    session = new_session(first)
    within(HEARD_WITHIN_S, "a session", lambda: second.status("GET", f"/v1/sessions/{session}") == 200)
    follower = Follower(second, f"/v1/sessions/{session}/events")
    within(10, "the first event", lambda: follower.events)
    longest = 0
    for number, reading in enumerate(readings[:6]):
        answered = add(first, session, [reading])["belief"]
        seen = lambda: follower.events[-1].get("belief", {}).get("revision") == number + 1
        longest = max(longest, within(10, f"the event of reading {number}", seen))
        assert follower.events[-1]["belief"] == answered, "the follower got another belief"
    first.call("POST", f"/v1/sessions/{session}/close")
    within(HEARD_WITHIN_S, "the end", lambda: follower.events[-1]["kind"] == "closed")
    print(f"a follower on another server: {len(follower.events)} events, at most {longest:.3f} s later")


def trainings(servers, start, first, second):
    """A training goes on when its server is killed, and its end is told once."""
    receiver = Receiver()
    hook = {"url": receiver.url, "events": ["training.finished", "session.decided"]}
    first.call("POST", "/v1/webhooks", hook)
    within(HEARD_WITHIN_S, "a webhook", lambda: second.call("GET", "/v1/webhooks")["items"])
    short = {"readings_per_object": 60, "activate": False}
    for server in (first, second):
        job = server.call("POST", "/v1/catalogues/default/trainings", short)["id"]
        ended = lambda: server.call("GET", f"/v1/jobs/{job}")["state"] == "succeeded"
        within(240, "a training", ended)
        told = lambda: [it["data"]["job"]["id"] for it in receiver.of_type("training.finished")]
        within(10, "its event", lambda: job in told())
    long = {**short, "readings_per_object": 3000}
    job = first.call("POST", "/v1/catalogues/default/trainings", long)["id"]
    show = lambda server: server.call("GET", f"/v1/jobs/{job}")
    within(30, "the beginning", lambda: show(second)["state"] == "running")
    third = start("third")
    assert show(third)["state"] == "running" and show(third)["reason"] is None, show(third)
    follower = Follower(third, f"/v1/jobs/{job}/events")
    # Who works on it shows its progress.
    workers = lambda: [it for it in (first, second) if show(it)["stage"] is not None]
    within(60, "its progress", workers)
    [worker] = workers()
    worker.stop(signal.SIGKILL)
    left = [server for server in (first, second, third) if server is not worker]
    resumed = lambda: any(show(server)["stage"] is not None for server in left)
    took = within(TAKEN_OVER_WITHIN_S, "another worker", resumed)
    within(600, "the end", lambda: show(left[0])["state"] == "succeeded")
    within(HEARD_WITHIN_S, "the end elsewhere", lambda: show(left[1])["state"] == "succeeded")
    within(HEARD_WITHIN_S, "its follower", lambda: follower.events[-1]["state"] == "succeeded")
    versions = left[0].call("GET", "/v1/catalogues/default/versions")["items"]
    assert len([it for it in versions if it["job"] == job]) == 1, versions
    within(TAKEN_OVER_WITHIN_S, "its event", lambda: job in told())
    n_told = collections.Counter(told())
    assert set(n_told.values()) == {1}, f"an event came twice: {n_told}"
    print(f"a training went on {took:.1f} s after its server was killed; {len(n_told)} events, each once")
    return left


def main():
    with cluster() as (folder, address, servers):
        train_in_a_folder(folder, servers)
        readings = simulated(folder)
        palpate("copy", "--from", f"sled:{folder}/folder", "--to", address)
        shared = ("--store", address, "--store-shared", "--webhook-allow-private")
        start = lambda name, key=None: servers.start(name, *shared, access="keys", key=key)
        first = start("first")
        with open(first.started["admin_key_file"]) as file:
            first.key = file.read().strip()
        second = start("second", first.key)
        keys(first, second)
        switches(first, second)
        audit(first, second)
        followers(first, second, readings)
        trainings(servers, lambda name: start(name, first.key), first, second)
        servers.expect_no_panic()


if __name__ == "__main__":
    try:
        main()
    except urllib.error.HTTPError as error:
        sys.exit(f"{error.url}: {error.code} {error.read().decode()}")
