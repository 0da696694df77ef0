"""``jaxclay deform``: squash a profile and write the new one."""

from __future__ import annotations

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

from jaxclay.clay.clay import Converted
from jaxclay.files.output import check_target
from jaxclay.files.profiles import PROFILES, is_special, loaded, save_profile
from jaxclay.files.svg import save_svg
from jaxclay.methods import METHODS
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash
from jaxclay.numerics.checks import check_tolerance
from jaxclay.solve.minimize import deform
from jaxclay.solve.solution import Solution, Status

_SLICES = 64
_MOST_SLICES = 1024  # some methods are dense
_MOST_BANDED = 65_536


def add_to(commands, interrupt: Callable[[], None]) -> None:
    """Add the command; ``interrupt`` raises where Ctrl-C was pressed."""
    command = commands.add_parser(
        "deform",
        help="squash a profile and write the new one",
        description="Squash a profile, several times in succession if asked, and write its contour "
        "as CSV.",
    )
    command.add_argument("profile", help=f"{', '.join(PROFILES)}, or a CSV file with height,radius")
    command.add_argument(
        "--squash", action="append", required=True, metavar="BOTTOM:TOP:RADIUS",
        help="in the profile's length unit; repeat it for a succession",
    )  # fmt: skip
    command.add_argument("--out", type=Path, required=True, help="CSV file to write")
    command.add_argument("--plot", type=Path, help="picture to write (PNG, SVG, PDF)")
    command.add_argument(
        "--slices", type=int, metavar="N",
        help="how many slices to solve on (default 64, or those of a file that jaxclay wrote)",
    )  # fmt: skip
    command.add_argument(
        "--scheme", choices=("slices", "paper"),
        help="slices of second order (default), or the paper's sums on slices of equal volume",
    )  # fmt: skip
    command.add_argument("--method", help=f"one of {', '.join(METHODS)} (default newton)")
    command.add_argument(
        "--tolerance", type=float, metavar="T",
        help="as many slices as bring the contour within this, over the height of the first piece",
    )  # fmt: skip
    command.add_argument("--svg", type=Path, help="outline to write, in millimetres")
    command.add_argument(
        "--millimetres", type=float, default=100.0, metavar="MM",
        help="of the SVG, for one length unit of the profile (default 100)",
    )  # fmt: skip
    command.add_argument("--top-fixed", action="store_true", help="hold the clay's upper end")
    for name in ("k", "mu", "alpha", "beta"):
        command.add_argument(f"--{name}", type=float, default=1.0, help="default 1")
    command.add_argument(
        "--units", choices=("snake", "printed"), default="snake",
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
    squashes = [parse_squash(text, options.top_fixed) for text in options.squash]
    make = Material.from_snake_units if options.units == "snake" else Material
    material = make(k=options.k, mu=options.mu, alpha=options.alpha, beta=options.beta)
    chosen = _chosen(options)
    _check_targets(options.out, options.plot, options.svg)
    clay, error = _profile(options, chosen)
    said: list[str] = []
    solution = None
    try:
        for text, squash in zip(options.squash, squashes, strict=True):
            interrupt()
            solution = deform(clay, squash, material, **chosen)
            if solution.status in (Status.INFEASIBLE, Status.NON_FINITE):
                raise ValueError(f"--squash {text}: {solution.message}")
            if solution.error_estimate is not None:
                error += float(solution.error_estimate)
            said.append(describe(text, solution, error))
            clay = solution.clay
        assert solution is not None  # --squash is required
        _write(solution, options)
        written = filter(None, (options.out, options.plot, options.svg))
        said.append("wrote " + " and ".join(str(path) for path in written))
    finally:  # not before the files are there, which printing must not cost
        for lines in said:
            print(lines)
    return 0


def _profile(options: argparse.Namespace, chosen: dict[str, Any]) -> Converted:
    """The clay to squash; sets how many slices to solve on, where no tolerance does."""
    clay, error = loaded(options.profile, minimum_radius=options.minimum_radius)
    if options.tolerance is None:
        kept = clay.slices if error == 0 else _SLICES  # a file that jaxclay wrote is exact
        chosen["slices"] = options.slices or kept
    elif error > options.tolerance:
        raise ValueError(
            f"{options.profile} in {clay.slices} slices is already {error:.2g} of the height off, "
            f"more than --tolerance {options.tolerance:g}: ask for {1.1 * error:.2g} or more"
        )
    return Converted(clay, error)


def _chosen(options: argparse.Namespace) -> dict[str, Any]:
    """What deform is asked for: slices, or a tolerance."""
    if options.tolerance is not None:
        if (options.slices, options.method, options.scheme) != (None, None, None):
            raise ValueError(
                "--tolerance goes without --slices, --scheme and --method: give one or the other"
            )
        check_tolerance(options.tolerance)
        return {"tolerance": options.tolerance}
    method = options.method or "newton"
    most = _MOST_BANDED if method == "newton" else _MOST_SLICES
    if options.slices is not None and options.slices > most:
        raise ValueError(f"slices must be at most {most} with {method}, got {options.slices}")
    return {"method": method, "scheme": options.scheme or "slices"}


def _check_targets(*targets: Path | None) -> None:
    """Raise before anything is solved if the files (CSV, picture, SVG) cannot be written."""
    for target in filter(None, targets):
        if target.is_dir():
            raise ValueError(f"{target} is a folder: name a file in it")
        folder = Path(os.path.realpath(target)).parent
        if not folder.is_dir():
            raise ValueError(f"no folder {folder} to write {target.name} into")
        check_target(target)
    names = [os.path.realpath(target) for target in filter(None, targets) if not is_special(target)]
    if len(set(names)) < len(names):
        raise ValueError(
            f"two of --out, --plot and --svg name the same file, {names[0]}: name one for each"
        )
    plot = targets[1]
    if plot is None:
        return
    from jaxclay.files import plots

    if plot.suffix.lower() not in plots.FORMATS:
        raise ValueError(f"--plot {plot}: the name must end in {', '.join(plots.FORMATS)}")


def _write(solution: Solution, options: argparse.Namespace) -> None:
    """Write all files, or none: each appears when the last has been made."""
    from contextlib import ExitStack

    from jaxclay.files.profiles import replacing

    with ExitStack() as files:
        if options.plot is not None:
            from jaxclay.files import plots

            plots.save(solution, files.enter_context(replacing(options.plot)))
        if options.svg is not None:
            path = files.enter_context(replacing(options.svg))
            save_svg(solution.clay, path, options.millimetres)
        save_profile(solution.clay, options.out)


def parse_squash(text: str, top_fixed: bool = False) -> Squash:
    """A squash from BOTTOM:TOP:RADIUS.

    Raises
    ------
    ValueError
        Not three numbers, or not a squash.
    """
    parts = text.split(":")
    try:
        numbers = [float(part) for part in parts]
    except ValueError:
        numbers = []
    if len(numbers) != 3:
        raise ValueError(f"--squash {text!r} is not BOTTOM:TOP:RADIUS, three numbers, as 0:0.3:0.4")
    return Squash(*numbers, top_fixed=top_fixed)


def describe(text: str, solution: Solution, error: float) -> str:
    """What a squash did, in a few lines.

    ``error`` is that of the contour over l, of the profile's slices and of all squashes together;
    said where a tolerance was asked for.
    """
    rough, certificate, terms = solution.rough, solution.certificate, solution.terms
    case = f"case {rough.case}" + (
        f", below {rough.case_below}" if rough.case_below != "none" else ""
    )
    clay = solution.clay
    accuracy = ""
    if solution.error_estimate is not None:
        accuracy = f", {int(solution.unknowns)} unknowns, contour within {error:.1e} of "
        accuracy += "the height, the profile's slices included"
    bound = ", lower bound active" if certificate.on_floor or rough.floored else ""
    return "\n".join(
        (
            f"squash {text}: {case}{bound}, {solution.status} after {int(solution.iterations)} "
            f"iterations of {solution.method} on {clay.slices} slices{accuracy}",
            f"  band {float(rough.bottom):.6g} to {float(rough.top):.6g}, "
            f"reach u1 = {float(rough.reach):.4g}",
            f"  E_total {float(solution.energy):.8g} = strain {float(terms.strain):.4g} + friction "
            f"{float(terms.friction):.4g} + tension {float(terms.tension):.4g} + bending "
            f"{float(terms.bending):.4g}; can still gain {float(certificate.decrement):.1e}",
            f"  height {float(clay.height):.6g}, radius {float(clay.radii.min()):.6g} to "
            f"{float(clay.radii.max()):.6g}, volume {float(clay.volume):.8g}",
        )
    )
