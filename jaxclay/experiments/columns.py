"""The columns of the results, their types and their units."""

from __future__ import annotations

import pyarrow as pa

_TEXT, _REAL, _WHOLE, _FLAG = pa.string(), pa.float64(), pa.int64(), pa.bool_()
_REALS = pa.list_(pa.float64())
_VERSIONS = ("jaxclay", "jax", "jaxlib", "jaxopt", "optax", "numpy", "python")

# name: type, what it is; l is the height of the piece when it first became clay.
COLUMNS: dict[str, tuple[pa.DataType, str]] = {
    "key": (_TEXT, "hash of all that determines the result"),
    "kind": (_TEXT, '"timing" (alone on one core, repeated) or "throughput" (many at once)'),
    "task": (_TEXT, "the task in a few words"),
    "scene": (_TEXT, "name of the scene or of its piece"),
    "specification": (_TEXT, "hash of the scene's inputs: the same scene solved in several ways"),
    "number": (_WHOLE, "of the scene in its table of the experiment file, when it was solved"),
    "source": (_TEXT, '"scene", "cylinder", a packaged profile or the path of a CSV file'),
    "units": (_TEXT, '"snake" or "printed": of alpha and beta; "move" where both are 0'),
    "place": (_TEXT, 'of a squash of a profile, "middle" or "shoulder"; empty for others'),
    "radius": (_REAL, "of a cylinder, its own length unit; 0 for other pieces"),
    "height": (_REAL, "of a cylinder, its own length unit; 0 for other pieces"),
    **dict.fromkeys(("k", "mu"), (_REAL, "material constant, no unit")),
    "alpha": (_REAL, "material constant in the units named, no unit"),
    "beta": (_REAL, "material constant in the units named, no unit"),
    "squashes": (_WHOLE, "in the succession; 0 for packaged scenes"),
    "band_bottom": (_REAL, "of the last squash, over the piece's height"),
    "band_height": (_REAL, "of the last squash, over the piece's height"),
    "band_ratio": (_REAL, "tool's radius over the piece's own at mid-band"),
    "scheme": (_TEXT, '"paper", "slices" or "spline"'),
    "spacing": (_TEXT, 'of the scheme "slices", "equal" on each side of the band or "placed"'),
    "degree": (_WHOLE, "of splines; 0 for others"),
    "slices": (_WHOLE, "0 for splines and to a tolerance"),
    "elements": (_WHOLE, "spans on each side of the band, for splines; 0 for slices"),
    "tolerance": (_REAL, "of the contour over l, for as many slices as it needs; 0 for others"),
    "method": (_TEXT, "a key of jaxclay.METHODS, or a peer"),
    "settings": (_TEXT, "of the method, where not its defaults"),
    "precision": (_TEXT, "of the method; the answer is certified in float64"),
    "budget": (_REAL, "seconds that the solve had; 0 for as many as it takes"),
    "call": (_TEXT, 'what is timed: "minimize" of a problem that is posed, or "deform"'),
    "packages": (_TEXT, "versions of what a peer is made of; empty for methods"),
    "status": (_TEXT, 'how the solve ended, or "out of time" or "skipped"'),
    "reason": (_TEXT, "the status explained"),
    "case": (_TEXT, "of the sliced cylinder model above the band"),
    "case_below": (_TEXT, "the same below the band"),
    "floored": (_FLAG, "whether the rough shape touches the thickness floor"),
    "energy": (_REAL, "E_total, no unit"),
    "energy_start": (_REAL, "E_total of the rough shape, no unit"),
    "energy_minimum": (_REAL, "E_total of the reference, no unit"),
    "energy_free": (_REAL, "E_free, the terms that touch what is free, no unit"),
    "gap": (_REAL, "energy - energy_minimum, no unit; missing where none is certified"),
    "gap_relative": (_REAL, "gap over energy_free"),
    "contour_error": (_REAL, "distance to the reference's contour, over l"),
    "contour_error_continuum": (
        _REAL,
        "distance to the continuum's minimum, by an answer on fine placed slices, over l",
    ),
    "continuum_error": (_REAL, "about how far that answer is off itself, over l"),
    "error_estimate": (_REAL, "estimate of the contour's error, over l; missing without tolerance"),
    "reference": (_TEXT, 'whose certified minimum the gap is from, or "none certified"'),
    "iterations": (_WHOLE, "of the method"),
    "unknowns": (_WHOLE, "free heights or coefficients"),
    "slack": (_REAL, "least thickness above the floor, over that at rest; below 0 is broken"),
    "decrement": (_REAL, "most energy the local model can still gain, no unit"),
    "step": (_REAL, "largest move to the local model's minimum, over l"),
    "residual": (_REAL, "largest unbalanced force over h (mu + k)"),
    "positive": (_FLAG, "whether the Hessian is positive definite"),
    "single_energy": (_REAL, "of float32, at the certified minimum: the energy's relative error"),
    "single_gradient": (_REAL, "of float32: the gradient's largest error, over h (mu + k)"),
    "single_decrement": (_REAL, "of float32: the decrement that the certificate would read"),
    "solve_s": (_REAL, "seconds of the call: median of repeats, or the share of a batch"),
    "solve_s_least": (_REAL, "seconds of the quickest repeat"),
    "solve_s_most": (_REAL, "seconds of the slowest repeat"),
    "compile_s": (
        _REAL, "seconds of compiling in that process, apart; missing for throughput, where it is in"
    ),
    "first_s": (_REAL, "seconds of the same call as the first of a process, where asked for"),
    "repeats": (_WHOLE, "timed runs"),
    "batch": (_WHOLE, "tasks of the compiled call that this one was solved in"),
    "pinned": (_WHOLE, "the core that a timing run was held on; -1 if not held"),
    **dict.fromkeys(_VERSIONS, (_TEXT, "version")),
    "machine": (_TEXT, "system, architecture and cores"),
    "processor": (_TEXT, "its name"),
    "host": (_TEXT, "the machine's name"),
    "device": (_TEXT, "what JAX computes on"),
    "code": (_TEXT, "hash of the package's modules that solve"),
    "blas_threads": (_WHOLE, "of the solving process"),
    "xla_threads": (_WHOLE, "of the solving process"),
    "cores": (_WHOLE, "that the solving process might use"),
    "process": (_WHOLE, "number of the solving process"),
    "finished": (_TEXT, "when, UTC, ISO 8601"),
}  # fmt: skip

# Those before the squash and of the rough shape, where methods start, are of timing runs.
_SHAPES = {"contour": "of the answer", "before": "before the squash", "start": "at the start"}
CURVES: dict[str, tuple[pa.DataType, str]] = {
    **{
        f"{name}_{what}": (_REALS, f"{what} of each point of the contour {which}, in the length "
                                   "unit of the clay")
        for name, which in _SHAPES.items()
        for what in ("height", "radius")
    },
    "trace_iterations": (_REALS, "iterations after which runs were ended"),
    "trace_s": (_REALS, "seconds of those runs"),
    "trace_energy": (_REALS, "E_total where they ended, no unit"),
}  # fmt: skip

SCHEMA = pa.schema([(name, kind) for name, (kind, _) in (COLUMNS | CURVES).items()])
