"""Mathematics that knows no clay.

``arrays``: one code for host and trace.  ``host``: how public functions meet JAX, float64 at the
door.  ``banded``: banded matrices.  ``banded_newton``: functions with a banded Hessian
minimised, by the loop in ``banded_steps`` and the searches in ``banded_search``.  ``roots``:
zeros and least values of functions of one number.  ``interpolation``: rising cubic pieces.
``distance``: between polylines.  ``checks``: what arguments may be.  ``compilations``: JAX's cache
on disk.

It imports nothing of the other rooms.
"""
