"""The house as its imports draw it: writes the diagram in jaxclay/README.md."""

from __future__ import annotations

import ast
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[1] / "jaxclay"
README = PACKAGE / "README.md"
ROOMS = (
    "numerics", "clay", "model", "schemes", "methods", "solve", "files", "experiments", "studio",
    "cli",
)  # fmt: skip
_BEGIN, _END = "<!-- made by scripts/house.py -->\n```text\n", "```\n<!-- end -->"


def counts() -> dict[tuple[str, str], int]:
    """How many imports there are from one room to another, late and typing-only ones included."""
    found: dict[tuple[str, str], int] = {}
    for room in ROOMS:
        for path in (PACKAGE / room).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("jaxclay."):
                    other = (node.module or "").split(".")[1]
                    if other in ROOMS and other != room:
                        found[room, other] = found.get((room, other), 0) + 1
    return found


def diagram() -> str:
    """A line a room, from the right: how often it imports which of those to its left."""
    found = counts()
    lines = ["imports of".rjust(14) + "".join(room.rjust(9) for room in ROOMS[:-3])]
    for room in ROOMS:
        cells = [str(found.get((room, other), "")) for other in ROOMS[:-3]]
        lines.append(room.rjust(14) + "".join(cell.rjust(9) for cell in cells))
    return "\n".join(line.rstrip() for line in lines) + "\n"


def main() -> None:
    """Put the diagram between its marks."""
    text = README.read_text(encoding="utf-8")
    before, rest = text.split(_BEGIN)
    _, after = rest.split(_END)
    README.write_text(before + _BEGIN + diagram() + _END + after, encoding="utf-8")


if __name__ == "__main__":
    main()
