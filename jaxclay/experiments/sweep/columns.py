"""The columns of the results, their types and their units."""

from __future__ import annotations

import pyarrow as pa

_TEXT, _REAL, _WHOLE, _FLAG = pa.string(), pa.float64(), pa.int64(), pa.bool_()
_REALS = pa.list_(pa.float64())

# name: type, what it is; l is the height of the piece when it first became clay.
COLUMNS: dict[str, tuple[pa.DataType, str]] = {
    "key": (_TEXT, "hash of the inputs, the package's version, dtype and device"),
    "kind": (_TEXT, '"timing" (alone on one core, repeated) or "throughput" (many at once)'),
    "task": (_TEXT, "the task in a few words"),
    "scene": (_TEXT, "name of the scene or of its piece"),
    "recipe": (_TEXT, "hash of the scene's inputs: the same scene solved in several ways"),
    "number": (_WHOLE, "of the scene in its table of the experiment file, when it was solved"),
    "source": (_TEXT, '"scene", "cylinder", a packaged profile or the path of a CSV file'),
    "units": (_TEXT, '"snake" or "printed": of alpha and beta'),
    "radius": (_REAL, "of a cylinder, its own length unit; 0 for other pieces"),
    "height": (_REAL, "of a cylinder, its own length unit; 0 for other pieces"),
    "k": (_REAL, "material constant, no unit"),
    "mu": (_REAL, "material constant, no unit"),
    "alpha": (_REAL, "material constant in the units named, no unit"),
    "beta": (_REAL, "material constant in the units named, no unit"),
    "squashes": (_WHOLE, "in the succession; 0 for packaged scenes"),
    "band_bottom": (_REAL, "of the last squash, over the piece's height"),
    "band_height": (_REAL, "of the last squash, over the piece's height"),
    "band_ratio": (_REAL, "tool's radius over the piece's own at mid-band"),
    "scheme": (_TEXT, '"paper", "slices" (equal on each side of the band) or "spline"'),
    "slices": (_WHOLE, "0 for splines and to a tolerance"),
    "elements": (_WHOLE, "spans on each side of the band, for splines; 0 for slices"),
    "tolerance": (_REAL, "of the contour over l, for as many slices as it needs; 0 for others"),
    "method": (_TEXT, "a key of jaxclay.METHODS"),
    "settings": (_TEXT, "of the method, where not its defaults"),
    "status": (_TEXT, 'how the solve ended, or "skipped"'),
    "reason": (_TEXT, "the status explained"),
    "case": (_TEXT, "of the sliced cylinder model above the band"),
    "case_below": (_TEXT, "the same below the band"),
    "floored": (_FLAG, "whether the rough shape touches the thickness floor"),
    "energy": (_REAL, "E_total, no unit"),
    "energy_start": (_REAL, "E_total of the rough shape, no unit"),
    "energy_minimum": (_REAL, "E_total of the reference, no unit"),
    "energy_free": (_REAL, "E_free, the terms that touch what is free, no unit"),
    "gap": (
        _REAL,
        "energy - energy_minimum, no unit; missing where none is certified",
    ),
    "gap_relative": (_REAL, "gap over energy_free"),
    "contour_error": (_REAL, "distance to the reference's contour, over l"),
    "contour_error_continuum": (
        _REAL,
        "distance to the continuum's minimum, by 1024 placed slices of second order, over l",
    ),
    "error_estimate": (_REAL, "estimate of the contour's error, over l; missing without tolerance"),
    "reference": (_TEXT, 'whose certified minimum the gap is from, or "none certified"'),
    "iterations": (_WHOLE, "of the method"),
    "unknowns": (_WHOLE, "free heights or coefficients"),
    "decrement": (_REAL, "most energy the local model can still gain, no unit"),
    "step": (_REAL, "largest move to the local model's minimum, over l"),
    "residual": (_REAL, "largest unbalanced force over h (mu + k)"),
    "positive": (_FLAG, "whether the Hessian is positive definite"),
    "solve_s": (_REAL, "seconds: median of repeats, or the share of a throughput call"),
    "solve_s_least": (_REAL, "seconds of the quickest repeat"),
    "solve_s_most": (_REAL, "seconds of the slowest repeat"),
    "compile_s": (_REAL, "seconds of compiling, apart; missing for throughput, where it is in"),
    "repeats": (_WHOLE, "timed runs"),
    "batch": (_WHOLE, "tasks of the compiled call that this one was solved in"),
    "pinned": (_WHOLE, "the core that a timing run was held on; -1 if not held"),
    "jaxclay": (_TEXT, "version"),
    "jax": (_TEXT, "version"),
    "jaxlib": (_TEXT, "version"),
    "jaxopt": (_TEXT, "version"),
    "optax": (_TEXT, "version"),
    "numpy": (_TEXT, "version"),
    "python": (_TEXT, "version"),
    "machine": (_TEXT, "system, architecture and cores"),
    "processor": (_TEXT, "its name"),
    "host": (_TEXT, "the machine's name"),
    "device": (_TEXT, "what JAX computes on"),
    "dtype": (_TEXT, "of the computation"),
    "cores": (_WHOLE, "that the solving process might use"),
    "process": (_WHOLE, "number of the solving process"),
    "finished": (_TEXT, "when, UTC, ISO 8601"),
}  # fmt: skip

CURVES: dict[str, tuple[pa.DataType, str]] = {
    "contour_height": (_REALS, "heights of the contour's points, the clay's length unit"),
    "contour_radius": (_REALS, "radii of the contour's points, the clay's length unit"),
    "trace_iterations": (_REALS, "iterations after which runs were ended"),
    "trace_s": (_REALS, "seconds of those runs"),
    "trace_energy": (_REALS, "E_total where they ended, no unit"),
}

SCHEMA = pa.schema([(name, kind) for name, (kind, _) in (COLUMNS | CURVES).items()])
