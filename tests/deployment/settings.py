"""Checks deploy/palpate.toml against the command: `settings.py PALPATE`.

The file must contain exactly the settings of the command, with the defaults commented out, and
the command must accept it unchanged and with every line enabled.
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
    """The output of `palpate config` for a file, by setting."""
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
