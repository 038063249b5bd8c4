"""Checks every query of deploy/ with a Prometheus that scrapes a server.

`figures.py PROMETHEUS SERVER`, with an admin's key in PALPATE_KEY. A query of the dashboard must
return a value, a query of an alert must be valid, and the server must have every metric and label
in either.
"""

import json
import os
import re
import sys
import time
import urllib.error
import urllib.parse
import urllib.request
from pathlib import Path

PROMETHEUS, SERVER = sys.argv[1], sys.argv[2]
ROOT = Path(__file__).resolve().parents[2]
KEY = {"authorization": f"Bearer {os.environ['PALPATE_KEY']}"}
WAIT_S = 60
ONLY_WITH_TLS = {"palpate_certificate_expiry_timestamp_seconds"}


def ask(url, body=None, headers=None):
    """The status and body of an answer."""
    data = None if body is None else json.dumps(body).encode()
    request = urllib.request.Request(url, data, {"content-type": "application/json", **(headers or {})})
    try:
        with urllib.request.urlopen(request, timeout=10) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()


def make_noise():
    """Causes the events behind every metric: refusals of a key and for overload."""
    status, _ = ask(f"{SERVER}/v1/objects")
    assert status == 401, status
    jobs = []
    for _ in range(200):
        status, text = ask(f"{SERVER}/v1/catalogues/default/trainings", {"activate": False}, KEY)
        if status != 202:
            break
        jobs.append(json.loads(text)["id"])
    assert status in (429, 503), status
    for job in jobs:
        ask(f"{SERVER}/v1/jobs/{job}/cancel", {}, KEY)


def robots_at_work():
    """Creates a session with a reading and its truth, so that the rates of answers exist."""
    _, session = ask(f"{SERVER}/v1/sessions", {}, KEY)
    image = [0.0] * 36
    pose = {"position": [0.5, 0.5, 0.5], "orientation": [0.0, 0.0, 0.0, 1.0]}
    reading = {"sensor": "digitacts-6x6", "pose": pose, "image": image}
    path = f"{SERVER}/v1/sessions/{json.loads(session)['id']}"
    for step, body in (("readings", {"readings": [reading]}), ("close", {"object": "mug"})):
        status, text = ask(f"{path}/{step}", body, KEY)
        assert status == 200, text


def queries():
    """Every query, its place, and whether it must return a value."""
    dashboard = json.loads((ROOT / "deploy/grafana/palpate.json").read_text())
    for panel in dashboard["panels"]:
        for target in panel.get("targets", []):
            yield f"panel {panel['title']!r}", target["expr"], True
    alerts = (ROOT / "deploy/prometheus/alerts.yml").read_text()
    rules = re.findall(r"alert: (\w+)\n\s+expr: (\|\n(?:\s{10,}.*\n)+|.*\n)", alerts)
    assert len(rules) == alerts.count("- alert:"), "an alert has an expression of another form"
    for name, expression in rules:
        yield f"alert {name}", expression.removeprefix("|\n"), False


def run(expression):
    """The answer of Prometheus: an error or '', and the values."""
    filled = expression.replace("$__rate_interval", "1m").replace("$instance", ".*")
    url = f"{PROMETHEUS}/api/v1/query?" + urllib.parse.urlencode({"query": filled})
    _, text = ask(url)
    answer = json.loads(text)
    if answer["status"] != "success":
        return answer["error"], []
    values = [float(series["value"][1]) for series in answer["data"]["result"]]
    return "", [value for value in values if value == value]


def known():
    """The server's metrics with their labels."""
    _, text = ask(f"{SERVER}/metrics")
    figures = {}
    for name, labels in re.findall(r"^(palpate_\w+)(?:\{(.*)\})? \S+$", text, re.M):
        figures.setdefault(name, set()).update(re.findall(r'(\w+)="', labels))
    return figures


def faults():
    """The present faults; some may be gone a moment later."""
    figures = known()
    named = set()
    for place, expression, must_answer in queries():
        for name, selector in re.findall(r"(palpate_\w+)(?:\{([^}]*(?:\{\w+\}[^}]*)*)\})?", expression):
            named.add(name)
            if name not in figures and name not in ONLY_WITH_TLS:
                yield f"{place}: the server has no {name}"
            labels = set(re.findall(r'(\w+)\s*=~?"', selector)) - {"instance", "job"}
            if not labels <= figures.get(name, labels):
                yield f"{place}: {name} has no label {labels - figures[name]}"
        error, values = run(expression)
        if error or (must_answer and not values):
            yield f"{place}: {error or 'nothing'} for {expression}"
    shown = {re.sub("_(bucket|sum|count)$", "", name) for name in named}
    unseen = {re.sub("_(bucket|sum|count)$", "", name) for name in figures} - shown
    if unseen:
        print("neither shown nor alerted on:", ", ".join(sorted(unseen)))


def documented_but_gone():
    """Metrics in the documentation that the server's sources do not have."""
    sources = "".join(path.read_text() for path in (ROOT / "server/src").rglob("*.rs"))
    for page in (ROOT / "docs").glob("*.md"):
        for name in re.findall(r"`(palpate_[a-z_]+[a-z])`", page.read_text()):
            if f'"{name}"' not in sources:
                yield f"{page.name}: the server has no {name}"


make_noise()
end = time.monotonic() + WAIT_S
while True:
    robots_at_work()
    found = list(faults())
    if not found or time.monotonic() > end:
        break
    time.sleep(1)
found += documented_but_gone()
if found:
    sys.exit("\n".join(found))
print(f"{len(list(queries()))} queries answer")
