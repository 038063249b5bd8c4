"""Executes notebooks; `--pictures FOLDER` keeps their last pictures there.

Notebooks are committed without outputs, so that no figure is stale; this fails if one has any.
"""

from __future__ import annotations

import base64
import sys
import tempfile
import time
from pathlib import Path

import nbformat
from nbclient import NotebookClient

CELL_S_MAX = 300


def run(path: Path, pictures: Path | None) -> None:
    """Executes one notebook in a folder of its own."""
    notebook = nbformat.read(path, as_version=4)  # type: ignore[no-untyped-call]
    kept = [cell for cell in notebook.cells if cell.get("outputs") or cell.get("execution_count")]
    if kept:
        sys.exit(f"{path.name} is committed with outputs: clear them")
    started = time.monotonic()
    with tempfile.TemporaryDirectory() as folder:
        resources = {"metadata": {"path": folder}}
        NotebookClient(notebook, timeout=CELL_S_MAX, resources=resources).execute()
    print(f"{time.monotonic() - started:6.1f} s {path.name}", flush=True)
    if pictures is not None:
        outputs = [output for cell in notebook.cells for output in cell.get("outputs", [])]
        found = [one["data"]["image/png"] for one in outputs if "image/png" in one.get("data", {})]
        for index, picture in enumerate(found):
            file = pictures / f"{path.stem}-{index + 1}.png"
            file.write_bytes(base64.b64decode(picture))
        text = [one.get("text") or one.get("data", {}).get("text/plain", "") for one in outputs]
        (pictures / f"{path.stem}.txt").write_text("\n".join(text))


def main() -> None:
    """Executes the notebooks that are named."""
    arguments = sys.argv[1:]
    pictures = None
    if arguments[:1] == ["--pictures"]:
        pictures = Path(arguments[1]).resolve()
        arguments = arguments[2:]
    for name in arguments:
        run(Path(name).resolve(), pictures)


if __name__ == "__main__":
    main()
