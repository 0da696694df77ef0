"""The splines' orders, unknowns and speed against their bounds, on the random population.

  a  orders in energy and contour, degrees 3 to 5, uniform spans
  b  unknowns for a contour error of 1e-4
  c  time to a contour error against the paper's scheme, solved by newton coarse to fine
  d  one squash, spans that adapt to 1e-4, and on 8 fixed spans a side
  e  Newton's iterations
  f  the estimate of the error against the error
  g  many squashes at once on all cores

Errors are measured from answers with an estimated error of 2e-6 at most; scenes where there is
none are left out and counted.  Times are of warm calls; "compiled" is the compiled call alone,
from a clay to a judged answer (on fixed spans and slices from a posed problem).  The last table
holds every bound; the exit status is 1 if one is not met.
"""

from __future__ import annotations

import os
import sys

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from bounds import run
from spline_accuracy import estimates, orders, unknowns
from spline_batch import batched
from spline_scenes import QUICK, THOROUGH
from spline_speed import against_the_paper, iterations, one_squash

PARTS = {
    "a": orders,
    "b": unknowns,
    "c": against_the_paper,
    "d": one_squash,
    "e": iterations,
    "f": estimates,
    "g": batched,
}


if __name__ == "__main__":
    sys.exit(run(PARTS, QUICK, THOROUGH, __doc__ or ""))
