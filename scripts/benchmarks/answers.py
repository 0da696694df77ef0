"""An answer at once: first answers, warm calls, tolerances and sessions, each beside its bound.

  a  first answers of a fresh process and the command line, in J: the CPU of jaxopt.LBFGS's first
  b  programs that a second session of 20 squashes compiles
  c  equations of the program of one solve with its certificate
  d  the compiled solve in K: one banded solve by SciPy, half-bandwidth 3, n = 512
  e  the public minimize call against IPOPT with exact sparse derivatives
  f  the public deform(slices=64) in solves
  g  deform to a tolerance: errors, estimates, slices and times over the population
  h  sessions of 20 squashes to a tolerance: refusals, errors, storage and times
  i  400 smooth random profiles
  j  locating a band
  k  batches of posed problems and of scenes to a tolerance
  l  dragging a tool

Medians, with least and most in brackets; compiling has its own column.  One thread for BLAS.  The
last table holds every bound; the exit status is 1 if one is not met.
"""

from __future__ import annotations

import os
import sys
from typing import NamedTuple

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # CasADi brings a BLAS of its own

from answers_accuracy import sessions, smooth_profiles, to_tolerance
from answers_processes import first_answers, second_session
from answers_speed import (
    against_ipopt,
    batched,
    dragged,
    in_banded_solves,
    locating,
    program_size,
    public_calls,
)
from bounds import run


class Effort(NamedTuple):
    """How thoroughly to measure."""

    processes: int  # fresh ones
    scenes: int  # of the population
    peers: int  # of them for IPOPT
    batch: int  # scenes of one call
    sessions: int  # for each material
    profiles: int
    seconds: float  # of timed repeats that a scene gets


PARTS = {
    "a": first_answers,
    "b": second_session,
    "c": program_size,
    "d": in_banded_solves,
    "e": against_ipopt,
    "f": public_calls,
    "g": to_tolerance,
    "h": sessions,
    "i": smooth_profiles,
    "j": locating,
    "k": batched,
    "l": dragged,
}
THOROUGH = Effort(5, 100, 20, 256, 30, 400, 0.2)
QUICK = Effort(1, 6, 3, 16, 1, 20, 0.02)
COUNTS = ("processes", "scenes", "sessions", "profiles")


if __name__ == "__main__":
    sys.exit(run(PARTS, QUICK, THOROUGH, __doc__ or "", COUNTS))
