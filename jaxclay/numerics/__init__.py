"""Mathematics that knows no clay.

``arrays``: one code for host and trace.  ``host``: how public functions meet JAX, float64 at the
door.  ``banded``, ``banded_newton``: banded matrices, and Newton's method on them.  ``roots``:
zeros and least values of functions of one number.  ``interpolation``: rising cubic pieces.
``distance``: between polylines.  ``checks``: what arguments may be.  ``compilations``: JAX's cache
on disk.

It imports nothing of the other rooms.
"""
