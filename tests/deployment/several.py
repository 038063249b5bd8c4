"""Checks deploy/cluster and deploy/kubernetes-cluster: `several.py HAPROXY MANIFESTS`.

Names in one file must be those of the others. HAProxy runs with two stand-ins for the servers: what
belongs to a session must go to one of them, and to the other one when that has gone.
"""

import http.server
import re
import subprocess
import sys
import tempfile
import threading
import time
import urllib.request
import uuid
from pathlib import Path

import yaml

ROOT = Path(__file__).resolve().parents[2]
CLUSTER = ROOT / "deploy/cluster"
N_SESSIONS = 40
READY_WITHIN_S = 200

services = yaml.safe_load((CLUSTER / "compose.yaml").read_text())["services"]
palpate = sorted(name for name in services if name.startswith("palpate"))
nats = sorted(name for name in services if name.startswith("nats"))
assert len(palpate) == 2 and len(nats) == 3, services.keys()
for name in palpate:
    store = services[name]["environment"]["PALPATE_STORE"]
    assert store == "nats://" + ",".join(f"{server}:4222" for server in nats), store
    assert services[name]["environment"]["PALPATE_STORE_SHARED"] == "true", name
folders = [volume.split(":")[0] for name in palpate + nats for volume in services[name]["volumes"]]
folders = [folder for folder in folders if not folder.startswith(".")]
assert len(set(folders)) == len(folders) == 5, f"two servers share a folder: {folders}"
for name in nats:
    assert services[name]["environment"]["NATS_NAME"] == name, name
settings = (CLUSTER / "nats.conf").read_text()
routes = re.findall(r"nats://([\w-]+):6222", settings)
assert sorted(routes) == nats, routes
assert "sync_interval: always" in settings, "acknowledged writes do not survive a loss of power"

proxy = (CLUSTER / "haproxy.cfg").read_text()
servers = re.findall(r"^ +server (\S+) (\S+):7411$", proxy, re.M)
assert sorted(servers) == sorted([(name, name) for name in palpate] * 2), servers

objects = [found for found in yaml.safe_load_all(Path(sys.argv[2]).read_text()) if found]
of = {it["kind"]: it for it in objects}
state = of["StatefulSet"]["spec"]
assert state["replicas"] > 1, state["replicas"]
environment = {it["name"]: it["value"] for it in state["template"]["spec"]["containers"][0]["env"]}
assert environment["PALPATE_STORE_SHARED"] == "true", environment
host, namespace, port = re.fullmatch(
    r"nats://(\w+)\.(\w+)\.svc:(\d+)/\w+", environment["PALPATE_STORE"]
).groups()
allowed = [
    (peer["namespaceSelector"]["matchLabels"]["kubernetes.io/metadata.name"], port["port"])
    for rule in of["NetworkPolicy"]["spec"]["egress"]
    for peer in rule["to"]
    for port in rule["ports"]
]
single = yaml.safe_load((ROOT / "deploy/kubernetes/networkpolicy.yaml").read_text())
before = [
    (peer["namespaceSelector"]["matchLabels"]["kubernetes.io/metadata.name"], port["port"])
    for rule in single["spec"]["egress"]
    for peer in rule["to"]
    for port in rule["ports"]
]
assert sorted(allowed) == sorted([*before, (namespace, int(port))]), allowed
selected = of["PodDisruptionBudget"]["spec"]["selector"]["matchLabels"].items()
assert selected <= state["template"]["metadata"]["labels"].items()


class StandIn:
    """A server that answers each request with its name."""

    def __init__(self, name):
        class Handler(http.server.BaseHTTPRequestHandler):
            protocol_version = "HTTP/1.1"

            def do_GET(self):
                self.send_response(200)
                self.send_header("content-length", str(len(name)))
                self.end_headers()
                self.wfile.write(name.encode())

            def log_message(self, *_):
                pass

        self.server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Handler)
        # HAProxy's checks hang up as soon as they know enough.
        self.server.handle_error = lambda *_: None
        self.port = self.server.server_address[1]
        threading.Thread(target=self.server.serve_forever, daemon=True).start()

    def stop(self):
        self.server.shutdown()
        self.server.server_close()


def answer(path):
    with urllib.request.urlopen(f"http://127.0.0.1:{entry}{path}", timeout=10) as answered:
        return answered.read().decode()


def until_ready():
    begun = time.monotonic()
    while True:
        try:
            return answer("/v1/catalogues")
        except OSError:
            assert time.monotonic() - begun < READY_WITHIN_S, "HAProxy does not answer"
            time.sleep(0.1)


stand_ins = {name: StandIn(name) for name in palpate}
free = http.server.HTTPServer(("127.0.0.1", 0), http.server.BaseHTTPRequestHandler)
entry = free.server_address[1]
free.server_close()
for name, stand_in in stand_ins.items():
    proxy = proxy.replace(f"{name}:7411", f"127.0.0.1:{stand_in.port}")
proxy = proxy.replace("bind :7411", f"bind 127.0.0.1:{entry}")
with tempfile.TemporaryDirectory() as folder:
    file = Path(folder) / "haproxy.cfg"
    file.write_text(proxy)
    process = subprocess.Popen([sys.argv[1], "-f", file], stdout=subprocess.DEVNULL)
    try:
        until_ready()
        sessions = [f"/v1/sessions/{uuid.uuid4()}" for _ in range(N_SESSIONS)]
        served = {path: answer(f"{path}/belief") for path in sessions}
        assert set(served.values()) == set(palpate), "one server has all sessions"
        for path, name in served.items():
            for end in ("", "/readings?belief=top", "/events"):
                assert answer(path + end) == name, f"{path} went to another server"
        gone = palpate[0]
        stand_ins[gone].stop()
        for path in sessions:
            assert answer(path) == palpate[1], path
    finally:
        process.terminate()
        process.wait()
print(f"{len(sessions)} sessions on {len(palpate)} servers behind HAProxy, and on one when the other has gone")
