"""Runs the Python blocks of a page in their order, in one namespace, as its reader would."""

import sys
from pathlib import Path

from blocks import blocks


def main() -> None:
    page = Path(sys.argv[1])
    found = [block for block in blocks(page) if block.language == "python"]
    assert found, f"{page} has no Python"
    names: dict[str, object] = {"__name__": "__main__"}
    for block in found:
        # Line numbers of errors are those of the page.
        lines = "\n" * block.line + block.text
        exec(compile(lines, str(page), "exec"), names)


if __name__ == "__main__":
    main()
