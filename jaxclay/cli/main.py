"""The command line: ``jaxclay compare``, ``deform``, ``sweep`` and the others."""

from __future__ import annotations

import argparse
import atexit
import dis
import os
import shlex
import signal
import sys
import traceback
import types

from jaxclay.cli.deform import add_to as add_deform
from jaxclay.cli.experiments.options import add_to as add_experiments
from jaxclay.cli.squashes import joined
from jaxclay.cli.starting import INTERRUPTED
from jaxclay.cli.studio import add_to as add_studio
from jaxclay.files.output import open_streams, patient_output
from jaxclay.numerics.checks import Hindrance
from jaxclay.numerics.compilations import keep_compilations
from jaxclay.version import __version__

_ABOUT = "Differentiable virtual clay: rotationally symmetric deformation by energy minimisation."
_BAD_INPUT = 2
_FAULT = 70  # as EX_SOFTWARE of sysexits.h


def entry() -> None:
    """The command ``jaxclay``: :func:`main`, and an end that no thread can spoil."""
    open_streams()
    signal.signal(signal.SIGINT, _interrupt)
    code = main()
    signal.signal(signal.SIGINT, lambda *_: os._exit(code))  # all is done
    if _interrupts:  # XLA may still compile in another thread, which nothing ends
        code = INTERRUPTED
    else:
        atexit._run_exitfuncs()
    # An end in good order aborts some of a hundred runs: XLA's and Arrow's threads outlive
    # what they use.
    os._exit(code)


def main(arguments: list[str] | None = None) -> int:
    """Run a command; 0 if it went well, 2 on bad input, 70 on a fault inside, 130 on Ctrl-C."""
    with patient_output():
        words = sys.argv[1:] if arguments is None else arguments
        try:
            return _run(_parser().parse_args(joined(words)))
        except KeyboardInterrupt:
            again = shlex.join(["jaxclay", *words])
            print(f"jaxclay: interrupted; go on, or begin anew, with\n  {again}", file=sys.stderr)
            return INTERRUPTED


def _run(options: argparse.Namespace) -> int:
    try:
        keep_compilations()
        code = options.run(options)
        sys.stdout.flush()
        return code
    except Exception as error:
        if _is_refusal(error):
            print(f"jaxclay {options.command}: error: {error}", file=sys.stderr)
            return _BAD_INPUT
        traceback.print_exc()
        print(f"jaxclay {options.command}: a fault inside, not in what was given", file=sys.stderr)
        return _FAULT


def _is_refusal(error: Exception) -> bool:
    """Whether the user's input, files or packages are the cause, rather than a fault inside.

    This package refuses input by a ValueError of its own; kinds of it, such as LinAlgError, and
    one that a library raises, or Python in a call from here, come from a fault.
    """
    if isinstance(error, Hindrance | OSError | ImportError):
        return True
    return type(error) is ValueError and _is_raised_here(error.__traceback__)


def _is_raised_here(deepest: types.TracebackType | None) -> bool:
    """Whether a ``raise`` of this package ends a traceback."""
    while deepest is not None and deepest.tb_next is not None:
        deepest = deepest.tb_next
    if deepest is None:
        return False
    frame = deepest.tb_frame
    instruction = dis.opname[frame.f_code.co_code[deepest.tb_lasti]]
    return instruction == "RAISE_VARARGS" and frame.f_globals["__name__"].startswith("jaxclay.")


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
    add_experiments(commands, check_interrupt)
    add_deform(commands, check_interrupt)
    add_studio(commands)
    return parser


if __name__ == "__main__":
    entry()
