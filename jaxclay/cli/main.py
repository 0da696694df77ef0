"""The command line: ``jaxclay compare``, ``deform``, ``sweep`` and the others."""

from __future__ import annotations

import argparse
import atexit
import os
import signal
import sys
import traceback
from pathlib import Path

from jaxclay.cli.deform import add_minimum_radius
from jaxclay.cli.deform import add_to as add_deform
from jaxclay.experiments.atlas.options import add_to as add_atlas
from jaxclay.experiments.sweep.options import add_to as add_sweep
from jaxclay.files.output import patient_output
from jaxclay.methods import METHODS
from jaxclay.numerics.checks import Hindrance
from jaxclay.numerics.compilations import keep_compilations
from jaxclay.version import __version__

_ABOUT = "Differentiable virtual clay: rotationally symmetric deformation by energy minimisation."
_BAD_INPUT = 2
_FAULT = 70  # as EX_SOFTWARE of sysexits.h
_INTERRUPTED = 130


def entry() -> None:
    """The command ``jaxclay``: :func:`main`, and an end that no thread can spoil."""
    signal.signal(signal.SIGINT, _interrupt)
    code = main()
    if _interrupts:  # XLA may still compile in another thread, which nothing ends
        code = _INTERRUPTED
    else:
        atexit._run_exitfuncs()
    # An end in good order aborts some of a hundred runs: XLA's and Arrow's threads outlive
    # what they use.
    os._exit(code)


def main(arguments: list[str] | None = None) -> int:
    """Run a command; 0 if it went well, 2 on bad input, 70 on a fault inside, 130 on Ctrl-C."""
    with patient_output():
        return _run(_parser().parse_args(arguments))


def _run(options: argparse.Namespace) -> int:
    keep_compilations()
    try:
        code = options.run(options)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt:
        print(f"jaxclay {options.command}: interrupted", file=sys.stderr)
        return _INTERRUPTED
    except Exception as error:
        if _is_refusal(error):
            print(f"jaxclay {options.command}: error: {error}", file=sys.stderr)
            return _BAD_INPUT
        traceback.print_exc()
        print(f"jaxclay {options.command}: a fault inside, not in what was given", file=sys.stderr)
        return _FAULT


def _is_refusal(error: Exception) -> bool:
    """Whether the user's input, files or packages are the cause, rather than a fault inside.

    This package raises ValueError itself; kinds of it, such as LinAlgError, come from elsewhere.
    """
    return type(error) is ValueError or isinstance(error, Hindrance | OSError | ImportError)


_interrupts: list[int] = []


def _interrupt(number, frame) -> None:
    _interrupts.append(number)
    raise KeyboardInterrupt


def check_interrupt() -> None:
    """Raise what a callback of JAX's may have swallowed."""
    if _interrupts:
        raise KeyboardInterrupt


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(prog="jaxclay", description=_ABOUT)
    parser.add_argument("--version", action="version", version=__version__)
    commands = parser.add_subparsers(dest="command", required=True)
    _add_compare(commands)
    add_atlas(commands, check_interrupt)
    add_deform(commands, check_interrupt)
    add_sweep(commands, check_interrupt)
    return parser


def _add_compare(commands) -> None:
    from jaxclay.experiments.compare.peers import PEERS
    from jaxclay.experiments.compare.plan import DEFAULT_METHODS

    others = [name for name in METHODS if name not in DEFAULT_METHODS]
    compare = commands.add_parser(
        "compare",
        help="methods side by side on many scenes: table, charts, report",
        description="Run scenes x methods x slices of the paper's scheme; print a table; write "
        "results, report, charts.",
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
    add_minimum_radius(compare)
    compare.set_defaults(run=_compare)


def _compare(options: argparse.Namespace) -> int:
    from jaxclay.experiments.compare.command import compare

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


if __name__ == "__main__":
    entry()
