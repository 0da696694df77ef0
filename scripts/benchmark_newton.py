"""Newton's speed and sureness against its bounds, every ratio taken side by side in this run.

  a  compiled newton, and the whole minimize call, against IPOPT
  b  newton in units of one banded solve by SciPy
  c  dragging a tool: median, 99th percentile, compilations
  d  time per slice of large pieces
  e  a squash of little reach in a window and as a whole
  f  iterations on each grid, coarse to fine
  g  the random population
  h  first calls in a fresh process, with and without a cache on disk

Medians, with least and most in brackets; compiling is never timed but in part h.  One thread for
BLAS.  The last table holds every bound; the exit status is 1 if one is not met.
"""

from __future__ import annotations

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # CasADi brings a BLAS of its own

from bounds import run
from newton_solves import against_ipopt, by_level, in_banded_solves
from newton_timing import Effort
from newton_uses import by_size, drag, first_calls, in_a_window, over_population

PARTS = {
    "a": against_ipopt,
    "b": in_banded_solves,
    "c": drag,
    "d": by_size,
    "e": in_a_window,
    "f": by_level,
    "g": over_population,
    "h": first_calls,
}
THOROUGH = Effort((64, 256, 1024, 4096), (4096, 65536), 0.5, 1000, 3)
QUICK = Effort((64, 256), (512, 1024), 0.1, 100, 1)


if __name__ == "__main__":
    sys.exit(run(PARTS, QUICK, THOROUGH, __doc__ or ""))
