"""``jaxclay deform``: squash a profile and write the new one."""

from __future__ import annotations

import argparse
import dataclasses
import os
import sys
from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from jaxclay.clay.clay import NEAR, Clay, Converted
from jaxclay.cli.squashes import describe, parse_squash, squash_of
from jaxclay.files.output import check_target
from jaxclay.files.piece import Piece, save_piece
from jaxclay.files.profiles import PROFILES, Profile, read_profile, save_profile
from jaxclay.files.replacing import is_special, replacing
from jaxclay.files.svg import save_svg
from jaxclay.files.units import UNITS
from jaxclay.methods import METHODS
from jaxclay.model.material import Material
from jaxclay.numerics.checks import check_positive, check_tolerance
from jaxclay.solve.minimize import deform
from jaxclay.solve.solution import Solution, Status

_SLICES = 64
_MOST_SLICES = 1024  # some methods are dense
_MOST_BANDED = 65_536
_TOLERANCE = 1e-3  # where neither that nor slices are asked for
_PART = 0.1  # of a tolerance, that cutting the profile into slices may take
_CONSTANTS = ("k", "mu", "alpha", "beta")


def add_to(commands, interrupt: Callable[[], None]) -> None:
    """Add the command; ``interrupt`` raises where Ctrl-C was pressed."""
    command = commands.add_parser(
        "deform",
        help="squash a profile and write the new one",
        description="Squash a profile, several times in succession if asked, and write its contour "
        "as CSV, and as a piece to go on from.",
    )
    command.add_argument(
        "profile",
        help=f"{', '.join(PROFILES)}, a table of height and radius (CSV), or a piece (JSON)",
    )
    command.add_argument(
        "--squash", action="append", required=True, metavar="BOTTOM:TOP:RADIUS",
        help="in the profile's lengths and heights; repeat it for a succession",
    )  # fmt: skip
    command.add_argument("--out", type=Path, required=True, help="CSV file to write")
    command.add_argument("--piece", type=Path, help="piece to write, JSON, to go on from exactly")
    command.add_argument("--plot", type=Path, help="picture to write (PNG, SVG, PDF)")
    command.add_argument(
        "--columns", metavar="HEIGHT,RADIUS", help="of the table: names, or numbers from 1"
    )
    command.add_argument("--unit", help=f"of the table's lengths: {', '.join(UNITS)}")
    command.add_argument(
        "--slices", type=int, metavar="N",
        help="how many slices to solve on, in place of a tolerance (default 64, or a piece's, "
        "with --scheme or --method)",
    )  # fmt: skip
    command.add_argument(
        "--scheme", choices=("slices", "paper"),
        help="slices of second order (default), or the paper's sums on slices of equal volume",
    )  # fmt: skip
    command.add_argument("--method", help=f"one of {', '.join(METHODS)} (default newton)")
    command.add_argument(
        "--tolerance", type=float, metavar="T",
        help="as many slices as bring the contour within this, over the height of the first piece "
        f"(default {_TOLERANCE:g})",
    )  # fmt: skip
    command.add_argument("--svg", type=Path, help="outline to write, in millimetres")
    command.add_argument("--mesh", type=Path, help="body to write in millimetres (STL, OBJ, GLB)")
    command.add_argument(
        "--wall", type=float, metavar="MM",
        help="of the mesh: a vessel of this thickness, for printing",
    )  # fmt: skip
    command.add_argument(
        "--millimetres", type=float, metavar="MM",
        help="of SVG and mesh, for one length unit of the profile (default: true size where the "
        "unit is known, else 100)",
    )  # fmt: skip
    command.add_argument("--top-fixed", action="store_true", help="hold the clay's upper end")
    for name in _CONSTANTS:
        command.add_argument(f"--{name}", type=float, help="default 1, or the piece's")
    command.add_argument(
        "--units", choices=("snake", "printed"),
        help="of alpha and beta: raw differences of 64 slices (default), or as printed (eq. 21)",
    )  # fmt: skip
    add_minimum_radius(command)
    command.set_defaults(run=lambda options: _deform(options, interrupt))


def add_minimum_radius(command) -> None:
    """Add --minimum-radius to a command that reads profiles."""
    command.add_argument(
        "--minimum-radius", type=float, metavar="R", help="raise smaller radii of CSV profiles to R"
    )


def _deform(options: argparse.Namespace, interrupt: Callable[[], None]) -> int:
    squashes = [(text, parse_squash(text)) for text in options.squash]
    chosen = _chosen(options)
    _check_targets(options)
    profile = read_profile(options.profile, options.minimum_radius, options.columns, options.unit)
    if profile.said:
        print(f"{profile.name}: {profile.said}", file=sys.stderr)
    material, (clay, error) = _material(options, profile), _cut(options, profile, chosen)
    said: list[str] = []
    solution = None
    try:
        for text, numbers in squashes:
            interrupt()
            squash = squash_of(text, numbers, options.top_fixed, clay, profile.base)
            # As a piece holds it, so that going on from one is the same.
            start = Piece(clay, base=profile.base).clay
            solution = deform(start, squash, material, **chosen)
            if solution.status in (Status.INFEASIBLE, Status.NON_FINITE):
                raise ValueError(f"--squash {text}: {solution.message}")
            if solution.error_estimate is not None:
                error += float(solution.error_estimate)
            said.append(describe(text, solution, error, profile.base))
            clay = solution.clay
        assert solution is not None  # --squash is required
        _write(solution, profile, material, options)
        written = filter(None, _targets(options).values())
        said.append("wrote " + " and ".join(str(path) for path in written))
    finally:  # not before the files are there, which printing must not cost
        for lines in said:
            print(lines)
    return 0


def _material(options: argparse.Namespace, profile: Profile) -> Material:
    """What the clay is made of: a piece's material, but for the constants that are given."""
    given = {name: value for name in _CONSTANTS if (value := getattr(options, name)) is not None}
    make = Material if options.units == "printed" else Material.from_snake_units
    if not isinstance(profile.drawn, Piece):
        return make(**{name: given.get(name, 1.0) for name in _CONSTANTS})
    if options.units is not None and not {"alpha", "beta"} & set(given):
        raise ValueError(
            f"--units {options.units} says what --alpha and --beta are in, but the material is "
            "the piece's: give them too"
        )
    made = make(**given)
    return dataclasses.replace(profile.drawn.material, **{n: getattr(made, n) for n in given})


def _cut(options: argparse.Namespace, profile: Profile, chosen: dict[str, Any]) -> Converted:
    """The clay to squash; sets how many slices to solve on, where no tolerance does."""
    tolerance = chosen.get("tolerance")
    clay, error = profile.cut(near=min(NEAR, _PART * (tolerance or 1.0)))
    if tolerance is None:
        kept = clay.slices if isinstance(profile.drawn, Piece) else _SLICES
        chosen["slices"] = options.slices or kept
    elif error > tolerance:
        raise ValueError(
            f"{options.profile} in {clay.slices} slices is already {error:.2g} of the height off, "
            f"more than --tolerance {tolerance:g}: ask for {1.1 * error:.2g} or more"
        )
    return Converted(clay, error)


def _chosen(options: argparse.Namespace) -> dict[str, Any]:
    """What deform is asked for: slices, or a tolerance."""
    other = (options.slices, options.method, options.scheme) != (None, None, None)
    if options.tolerance is not None and other:
        raise ValueError(
            "--tolerance goes without --slices, --scheme and --method: give one or the other"
        )
    if not other:
        tolerance = _TOLERANCE if options.tolerance is None else options.tolerance
        check_tolerance(tolerance)
        return {"tolerance": tolerance}
    method = options.method or "newton"
    most = _MOST_BANDED if method == "newton" else _MOST_SLICES
    if options.slices is not None and options.slices > most:
        raise ValueError(f"slices must be at most {most} with {method}, got {options.slices}")
    return {"method": method, "scheme": options.scheme or "slices"}


def _targets(options: argparse.Namespace) -> dict[str, Path | None]:
    """The files to write, by their options."""
    return {f"--{name}": getattr(options, name) for name in ("out", "piece", "plot", "svg", "mesh")}


def _check_targets(options: argparse.Namespace) -> None:
    """Raise before anything is solved if the files cannot be written."""
    targets = {option: path for option, path in _targets(options).items() if path is not None}
    for target in targets.values():
        if target.is_dir():
            raise ValueError(f"{target} is a folder: name a file in it")
        folder = Path(os.path.realpath(target)).parent
        if not folder.is_dir():
            raise ValueError(f"no folder {folder} to write {target.name} into")
        check_target(target)
    names = [os.path.realpath(target) for target in targets.values() if not is_special(target)]
    if len(set(names)) < len(names):
        twice = next(name for name in names if names.count(name) > 1)
        raise ValueError(
            f"two of {', '.join(targets)} name the same file, {twice}: name one for each"
        )
    if options.piece is not None and options.piece.suffix.lower() != ".json":
        raise ValueError(f"--piece {options.piece}: the name must end in .json")
    _check_mesh(options)
    if options.plot is None:
        return
    from jaxclay.files import plots

    if options.plot.suffix.lower() not in plots.FORMATS:
        raise ValueError(f"--plot {options.plot}: the name must end in {', '.join(plots.FORMATS)}")


def _check_mesh(options: argparse.Namespace) -> None:
    """Raise before anything is solved if the mesh cannot be made."""
    if options.mesh is None:
        if options.wall is not None:
            raise ValueError(f"--wall {options.wall:g} belongs to --mesh, which is not given")
        return
    from jaxclay.files.mesh import FORMATS, mesh_of

    if options.mesh.suffix.lower() not in FORMATS:
        raise ValueError(f"--mesh {options.mesh}: the name must end in {', '.join(FORMATS)}")
    mesh_of(Clay.cylinder(), rings=8)  # or trimesh is missing
    if options.wall is not None:
        check_positive("--wall", options.wall)


def _write(
    solution: Solution, profile: Profile, material: Material, options: argparse.Namespace
) -> None:
    """Write all files, or none: each appears when the last has been made."""
    base, unit = profile.base, profile.length_unit
    millimetres = options.millimetres or UNITS.get(unit or "") or 100.0
    with ExitStack() as files:
        if options.plot is not None:
            from jaxclay.files import plots

            plots.save(solution, files.enter_context(replacing(options.plot)), base)
        if options.svg is not None:
            path = files.enter_context(replacing(options.svg))
            save_svg(solution.clay, path, millimetres)
        if options.mesh is not None:
            from jaxclay.files.mesh import save_mesh

            path = files.enter_context(replacing(options.mesh))
            save_mesh(solution.clay, path, millimetres, options.wall)
        if options.piece is not None:
            piece = Piece(solution.clay, material, base=base, length_unit=unit)
            save_piece(files.enter_context(replacing(options.piece)), piece)
        save_profile(solution.clay, options.out, base, unit)
