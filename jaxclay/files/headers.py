"""What headers of tables call the height and the radius, and in what units."""

from __future__ import annotations

import re

from jaxclay.files.units import unit_named

HEIGHT = "height"
# What headers call a quantity; of two columns that may be it, the one whose name stands first.
_NAMES = {
    HEIGHT: (
        {"height", "heights", "höhe", "hoehe", "hauteur", "altura", "altezza", "hoogte"},
        {"z"}, {"h"}, {"y"},
    ),
    "radius": ({"radius", "radii", "rad", "rayon", "radio", "raggio", "straal"}, {"r"}, {"x"}),
    "diameter": (
        {"diameter", "diameters", "diametre", "diamètre", "diametro", "diámetro", "durchmesser",
         "dia", "diam", "ø", "⌀"},
        {"d"},
    ),
    "circumference": (
        {"circumference", "girth", "umfang", "circonférence", "circonferenza", "circunferencia"},
        {"c"},
    ),
}  # fmt: skip
# Written in full before a letter, and a radius before what it is worked out from.
ACROSS = [("radius", 0), ("diameter", 0), ("circumference", 0)]
ACROSS += [("radius", 1), ("diameter", 1), ("circumference", 1), ("radius", 2)]
_BY_THE_WAY = {"in", "of", "the", "outer", "outside", "profile", "axis", "coordinate", "from"}


def one_of(line: int, cells: list[str], order: list[tuple[str, int]]) -> tuple[str, int] | None:
    """The first quantity of the order that a column is named after, and that column."""
    for quantity, rank in order:
        places = [i for i, cell in enumerate(cells) if rank_of(quantity, cell) == rank]
        if len(places) > 1:
            twice = ", ".join(cells[i] for i in places)
            raise ValueError(
                f"line {line}: the header names {quantity} twice, {twice}: say which is meant, "
                f"--columns {cells[0]},{cells[places[0]]}"
            )
        if places:
            return quantity, places[0]
    return None


def rank_of(quantity: str, cell: str) -> int | None:
    """How far down the quantity's names a cell of the header stands; None if it is none."""
    name = named(cell)[0]
    return next((i for i, names in enumerate(_NAMES[quantity]) if name in names), None)


def named(cell: str) -> tuple[str, str | None]:
    """What a cell of the header names, without its unit and words by the way; and the unit."""
    words = [word for word in re.split(r"[\s()\[\]{}<>/_,:;.=\"'-]+", cell.casefold()) if word]
    inch = re.search(r"[(\[]\s*\"\s*[)\]]", cell)
    unit = "in" if inch else unit_named(words[-1]) if len(words) > 1 else None
    words = words[:-1] if unit and not inch else words
    return " ".join(word for word in words if word not in _BY_THE_WAY), unit


def bare(name: str) -> str:
    """The name without a unit in brackets."""
    return re.sub(r"\s*[(\[][^)\]]*[)\]]$", "", name)
