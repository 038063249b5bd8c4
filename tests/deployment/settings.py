"""Holds deploy/palpate.toml against the command: `settings.py PALPATE`.

Every setting that the command has must stand in the file, and nothing else; what is commented
out must be the default; and the file must be taken as it is and with everything in it.
"""

import json
import os
import re
import subprocess
import sys
import tempfile
from pathlib import Path

FILE = Path(__file__).resolve().parents[2] / "deploy/palpate.toml"
ENVIRONMENT = {k: v for k, v in os.environ.items() if not k.startswith("PALPATE_")}


def effective(path: str | None) -> dict[str, dict]:
    """What `palpate config` says with a file, by setting."""
    file = [] if path is None else ["--config", path]
    said = subprocess.run(
        [sys.argv[1], "config", "--json", *file], env=ENVIRONMENT, capture_output=True, text=True
    )
    assert said.returncode == 0, said.stderr
    return {setting["name"]: setting for setting in json.loads(said.stdout)}


defaults = effective(None)
with tempfile.NamedTemporaryFile("w", suffix=".toml") as everything:
    everything.write(re.sub(r"^#(\w+ = )", r"\1", FILE.read_text(), flags=re.M))
    everything.flush()
    given = effective(everything.name)
missing = sorted(name for name, setting in given.items() if setting["source"] == "default")
assert not missing, f"deploy/palpate.toml does not have {', '.join(missing)}"
for name, setting in given.items():
    default = defaults[name]["value"]
    assert default in (None, "", setting["value"]), f"{name}: {setting['value']} is not the default, {default}"
as_it_is = {name: setting["value"] for name, setting in effective(str(FILE)).items()}
assert as_it_is == {name: setting["value"] for name, setting in defaults.items()}
print(f"{len(given)} settings, all of them known")
