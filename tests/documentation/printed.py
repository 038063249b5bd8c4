"""What a page says that a command prints, held against what it printed.

The plain block below a block of commands is its output. Lines stand in the order in which they
are printed; lines that no reader needs may be left out. `…` stands for any text. Ids, durations
and the width of gaps do not count; all other numbers do.
"""

import difflib
import re

ANY = {
    r"[0-9a-f]{8}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{4}-[0-9a-f]{12}": "ID",
    r"\b[0-9a-f]{8}-…": "ID",
    r"\b\d+(\.\d+)? (ms|s)\b": "DURATION",
    r"\b\d{4}-\d\d-\d\dT[0-9:.]+Z": "TIME",
}
"""Forms that differ at every run, and what stands for them."""


def plain(line: str) -> str:
    """A line without what differs at every run."""
    for form, name in ANY.items():
        line = re.sub(form, name, line)
    return " ".join(line.split())


def fits(expected: str, line: str) -> bool:
    """Whether a line of output is the one on the page."""
    parts = [re.escape(part.strip()) for part in plain(expected).split("…")]
    return re.fullmatch(r"\s*.*\s*".join(parts), plain(line)) is not None


def missing(page: str, output: str) -> list[str]:
    """The lines of a page's block that the output does not have, each with the nearest that it has."""
    printed = [line for line in output.splitlines() if line.strip()]
    faults, at = [], 0
    for expected in page.splitlines():
        if expected.strip() in ("", "…"):
            continue
        found = next((n for n in range(at, len(printed)) if fits(expected, printed[n])), None)
        if found is None:
            nearest = difflib.get_close_matches(expected, printed, 1, 0.3)
            faults.append(f"  page:    {expected}\n  printed: {nearest[0] if nearest else 'nothing like it'}")
        else:
            at = found + 1
    return faults
