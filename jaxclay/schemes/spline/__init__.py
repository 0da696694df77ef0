"""Scheme "spline": the displacement from the rest shape as a B-spline in u, on equal spans.

A check from elsewhere than slices: the radius follows from Y_u exactly, and the energy's densities
are integrated by Gauss points.  ``bspline`` and ``mesh`` know splines, ``space`` what the energy
samples of them, ``problem`` and ``pose`` a squash.  Its minimum is found by ``solve/on_spans``.
"""
