"""Backs up the running server and restores it: `restore.py PALPATE SERVER FOLDER`.

With an admin's key in PALPATE_KEY. Backups into one folder keep the newest. The newest is restored
into a new folder, and a server of that folder must answer as the first one does: catalogues with
their versions, objects, sessions, readings and beliefs. A server forms the newest beliefs of its
open sessions in the background after its start, and lists them from then on.
"""

import json
import os
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

PALPATE, SERVER, FOLDER = sys.argv[1], sys.argv[2], Path(sys.argv[3])
KEY = {"authorization": f"Bearer {os.environ['PALPATE_KEY']}"}
KEPT = 2


def run(*arguments):
    """The JSON answer of a command."""
    said = subprocess.run([PALPATE, *arguments, "--json"], capture_output=True, text=True)
    assert said.returncode == 0, said.stderr
    return json.loads(said.stdout)


def ask(server, path):
    """The JSON answer of a server."""
    with urllib.request.urlopen(urllib.request.Request(server + path, headers=KEY), timeout=60) as answer:
        return json.loads(answer.read())


def sessions_with_beliefs(server, wait_s=60):
    """The sessions, once each that has readings shows its newest belief."""
    for _ in range(wait_s * 10):
        sessions = ask(server, "/v1/sessions?limit=100")["items"]
        if all(session["latest"] or not session["n_readings"] for session in sessions):
            return sessions
        time.sleep(0.1)
    raise AssertionError(f"sessions without a belief after {wait_s} s: {sessions}")


def content(server):
    """What a server serves, as far as robots and operators see it."""
    sessions = sessions_with_beliefs(server)
    paths = ["/v1/objects?limit=100", "/v1/catalogues?limit=100", "/v1/sensors?limit=100"]
    paths += ["/v1/catalogues/default", "/v1/catalogues/default/versions/1"]
    for session in sessions:
        at = f"/v1/sessions/{session['id']}"
        paths += [at, f"{at}/belief", f"{at}/readings"]
    return {path: ask(server, path) for path in paths}


assert not FOLDER.exists()
backups = []
for _ in range(KEPT + 1):
    backups.append(run("snapshot", "backup", str(FOLDER / "backups"), "--keep", str(KEPT)))
    # Names have seconds.
    time.sleep(1.1)
kept = sorted(FOLDER.glob("backups/*"))
assert [str(file) for file in kept] == [backup["file"] for backup in backups[1:]], kept
assert backups[-1]["removed"] == [backups[0]["file"]], backups
before = content(SERVER)
assert any(path.endswith("/belief") for path in before), "no session to compare"

data = FOLDER / "data"
run("snapshot", "restore", str(kept[-1]), "--data", str(data), "--keys", "keep")
restored = subprocess.Popen(
    [PALPATE, "serve", "--listen", "127.0.0.1:0", "--data", str(data), "--access", "keys", "--json"],
    stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True,
)  # fmt: skip
try:
    started = json.loads(restored.stdout.readline())
    after = content(started["server"])
    for path, answer in before.items():
        assert after[path] == answer, f"{path}: {after[path]} after the restoration, {answer} before"
finally:
    restored.terminate()
    assert restored.wait(timeout=60) == 0
print(f"a restored server gives the same {len(before)} answers")
