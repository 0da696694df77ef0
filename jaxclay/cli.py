"""The command line: ``jaxclay compare``, ``jaxclay atlas`` and ``jaxclay deform``."""

from __future__ import annotations

import argparse
import os
import signal
import sys
from pathlib import Path

import jaxclay
from jaxclay.atlas.options import add_to as add_atlas

_BAD_INPUT = 2
_INTERRUPTED = 130
_MOST_SLICES = 1024  # some methods are dense
_MOST_BANDED = 65_536


def entry() -> None:
    """The command ``jaxclay``: :func:`main`, and an end that Ctrl-C cannot spoil."""
    signal.signal(signal.SIGINT, _interrupt)
    code = main()
    if _interrupts:
        # Leaving while XLA still compiles in another thread would crash.
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(_INTERRUPTED)
    sys.exit(code)


def main(arguments: list[str] | None = None) -> int:
    """Run a command; 0 if it went well, 2 on bad input, 130 on Ctrl-C."""
    options = _parser().parse_args(arguments)
    keep_compilations()
    try:
        return options.run(options)
    except (ValueError, OSError, ImportError) as error:
        print(f"jaxclay {options.command}: error: {error}", file=sys.stderr)
        return _BAD_INPUT
    except KeyboardInterrupt:
        print(f"jaxclay {options.command}: interrupted", file=sys.stderr)
        return _INTERRUPTED


_interrupts: list[int] = []


def _interrupt(number, frame) -> None:
    _interrupts.append(number)
    raise KeyboardInterrupt


def check_interrupt() -> None:
    """Raise what a callback of JAX's may have swallowed."""
    if _interrupts:
        raise KeyboardInterrupt


def keep_compilations() -> None:
    """Keep JAX's compilations on disk, so that the second run of anything starts at once."""
    import jax

    cache = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = os.environ.get("JAX_COMPILATION_CACHE_DIR", str(cache / "jaxclay" / "compilations"))
    jax.config.update("jax_compilation_cache_dir", folder)
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0)
    jax.config.update("jax_persistent_cache_min_entry_size_bytes", -1)


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="jaxclay", description=jaxclay.__doc__)
    parser.add_argument("--version", action="version", version=jaxclay.__version__)
    commands = parser.add_subparsers(dest="command", required=True)
    _add_compare(commands)
    add_atlas(commands, check_interrupt)
    _add_deform(commands)
    return parser


def _add_compare(commands) -> None:
    from jaxclay.compare.peers import PEERS
    from jaxclay.compare.plan import DEFAULT_METHODS

    others = [name for name in jaxclay.METHODS if name not in DEFAULT_METHODS]
    compare = commands.add_parser(
        "compare",
        help="methods side by side on many scenes: table, charts, report",
        description="Run scenes x methods x slices; print a table; write results, report, charts.",
    )
    compare.add_argument("--out", type=Path, default=Path("out/compare"), help="output folder")
    compare.add_argument("--scenes", nargs="+", metavar="NAME", help="only these scenes")
    compare.add_argument(
        "--methods", nargs="+", metavar="NAME",
        help=f"only these methods (default {', '.join(DEFAULT_METHODS)}; also {', '.join(others)})",
    )  # fmt: skip
    compare.add_argument(
        "--peers", nargs="*", metavar="NAME",
        help="established solvers from outside as well, and E_move alone: those named, or all of "
        f"{', '.join(PEERS)} (pip install 'jaxclay[peers]')",
    )  # fmt: skip
    compare.add_argument(
        "--slices", nargs="+", type=int, metavar="N", help="grids of the table (default 64 128)"
    )
    compare.add_argument("--profiles", type=Path, metavar="FOLDER", help="add every CSV in FOLDER")
    compare.add_argument("--quick", action="store_true", help="few scenes, 64 slices, few repeats")
    _add_minimum_radius(compare)
    compare.set_defaults(run=_compare)


def _compare(options: argparse.Namespace) -> int:
    from jaxclay.compare.command import compare

    return compare(
        out=options.out,
        scenes=options.scenes,
        methods=options.methods,
        slices=options.slices,
        profiles=options.profiles,
        quick=options.quick,
        minimum_radius=options.minimum_radius,
        peers=options.peers,
        interrupt=check_interrupt,
    )


def _add_deform(commands) -> None:
    deform = commands.add_parser(
        "deform",
        help="squash a profile and write the new one",
        description="Squash a profile, several times in succession if asked, and write its contour "
        "as CSV.",
    )
    deform.add_argument(
        "profile", help=f"{', '.join(jaxclay.PROFILES)}, or a CSV file with height,radius"
    )
    deform.add_argument(
        "--squash", action="append", required=True, metavar="BOTTOM:TOP:RADIUS",
        help="in the profile's length unit; repeat it for a succession",
    )  # fmt: skip
    deform.add_argument("--out", type=Path, required=True, help="CSV file to write")
    deform.add_argument("--plot", type=Path, help="picture to write (PNG, SVG, PDF)")
    deform.add_argument("--slices", type=int, help="default 64, or what a jaxclay file has")
    deform.add_argument("--method", default="newton", help=f"one of {', '.join(jaxclay.METHODS)}")
    deform.add_argument("--top-fixed", action="store_true", help="hold the clay's upper end")
    for name in ("k", "mu", "alpha", "beta"):
        deform.add_argument(f"--{name}", type=float, default=1.0, help="default 1")
    deform.add_argument(
        "--units", choices=("snake", "printed"), default="snake",
        help="of alpha and beta: raw differences of 64 slices (default), or as printed (eq. 21)",
    )  # fmt: skip
    _add_minimum_radius(deform)
    deform.set_defaults(run=_deform)


def _add_minimum_radius(command) -> None:
    command.add_argument(
        "--minimum-radius", type=float, metavar="R", help="raise smaller radii of CSV profiles to R"
    )


def _deform(options: argparse.Namespace) -> int:
    squashes = [parse_squash(text, options.top_fixed) for text in options.squash]
    make = jaxclay.Material.from_snake_units if options.units == "snake" else jaxclay.Material
    material = make(k=options.k, mu=options.mu, alpha=options.alpha, beta=options.beta)
    most = _MOST_BANDED if options.method == "newton" else _MOST_SLICES
    if options.slices is not None and options.slices > most:
        raise ValueError(
            f"slices must be at most {most} with {options.method}, got {options.slices}"
        )
    _check_targets(options.out, options.plot)
    clay = jaxclay.load_profile(options.profile, options.slices, options.minimum_radius)
    solution = None
    for text, squash in zip(options.squash, squashes, strict=True):
        check_interrupt()
        solution = jaxclay.deform(clay, squash, material, method=options.method)
        if solution.status in (jaxclay.Status.INFEASIBLE, jaxclay.Status.NON_FINITE):
            raise ValueError(f"--squash {text}: {solution.message}")
        print(describe(text, solution))
        clay = solution.clay
    assert solution is not None  # --squash is required
    _write(solution, options.out, options.plot)
    print(f"wrote {options.out}" + (f" and {options.plot}" if options.plot else ""))
    return 0


def _check_targets(out: Path, plot: Path | None) -> None:
    """Raise before anything is solved if the files cannot be written."""
    for target in filter(None, (out, plot)):
        if target.is_dir():
            raise ValueError(f"{target} is a folder: name a file in it")
        if not target.absolute().parent.is_dir():
            raise ValueError(f"no folder {target.absolute().parent} to write {target.name} into")
    if plot is None:
        return
    if plot.absolute() == out.absolute():
        raise ValueError(f"--out and --plot both name {out}: name two files")
    from jaxclay import plots

    if plot.suffix.lower() not in plots.FORMATS:
        raise ValueError(f"--plot {plot}: the name must end in {', '.join(plots.FORMATS)}")


def _write(solution: jaxclay.Solution, out: Path, plot: Path | None) -> None:
    """Write both files, or neither."""
    from jaxclay.profiles import replacing

    if plot is None:
        jaxclay.save_profile(solution.clay, out)
        return
    from jaxclay import plots

    with replacing(plot) as temporary:
        plots.save(solution, temporary)
        jaxclay.save_profile(solution.clay, out)


def parse_squash(text: str, top_fixed: bool = False) -> jaxclay.Squash:
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
    return jaxclay.Squash(*numbers, top_fixed=top_fixed)


def describe(text: str, solution: jaxclay.Solution) -> str:
    """What a squash did, in a few lines."""
    rough, certificate, terms = solution.rough, solution.certificate, solution.terms
    case = f"case {rough.case}" + (
        f", below {rough.case_below}" if rough.case_below != "none" else ""
    )
    radii = solution.clay.radii
    floor = ", thickness floor active" if certificate.on_floor or rough.floored else ""
    return "\n".join(
        (
            f"squash {text}: {case}{floor}, {solution.status} after {int(solution.iterations)} "
            f"iterations of {solution.method}",
            f"  band {float(rough.bottom):.6g} to {float(rough.top):.6g}, "
            f"reach u1 = {float(rough.reach):.4g}",
            f"  E_total {float(solution.energy):.8g} = strain {float(terms.strain):.4g} + friction "
            f"{float(terms.friction):.4g} + tension {float(terms.tension):.4g} + bending "
            f"{float(terms.bending):.4g}; can still gain {float(certificate.decrement):.1e}",
            f"  height {float(solution.clay.height):.6g}, radius {float(radii.min()):.6g} to "
            f"{float(radii.max()):.6g}, volume {float(solution.clay.volume):.8g}",
        )
    )
