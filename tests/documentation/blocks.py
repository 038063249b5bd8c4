"""The fenced blocks of a Markdown page, each with the marker above it.

A marker is an HTML comment on the line(s) directly above a block, such as
`<!-- clients: install -->`; it is invisible on the page.
"""

from dataclasses import dataclass
from pathlib import Path

FENCE = "```"


@dataclass(frozen=True)
class Block:
    """A fenced block: its line, its language, its text, and its marker or ''."""

    page: str
    line: int
    language: str
    text: str
    marker: str

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def blocks(page: Path) -> list[Block]:
    """All fenced blocks of a page, in order."""
    found: list[Block] = []
    marker, comment, inside = "", None, None
    for number, line in enumerate(page.read_text().splitlines(), start=1):
        if inside is not None:
            if line.strip() == FENCE:
                start, language, lines = inside
                found.append(Block(page.name, start, language, "\n".join(lines) + "\n", marker))
                marker, inside = "", None
            else:
                inside[2].append(line)
        elif line.startswith(FENCE):
            inside = (number, line[len(FENCE) :].strip(), [])
        elif comment is not None or line.startswith("<!--"):
            comment = [*(comment or []), line]
            if line.rstrip().endswith("-->"):
                marker = "\n".join(comment).removeprefix("<!--").removesuffix("-->").strip()
                comment = None
        elif line.strip():
            marker = ""
    if inside is not None:
        raise ValueError(f"{page}:{inside[0]}: the block does not end")
    return found
