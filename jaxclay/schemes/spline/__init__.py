"""Scheme "spline": the displacement from the rest shape as a B-spline in u.

A dozen coefficients do what takes the paper's scheme thousands of slices: the
radius follows from Y_u exactly, and the energy's densities are integrated by
Gauss points.  ``bspline`` and ``mesh`` know splines, ``space`` what the energy
samples of them, ``problem`` and ``pose`` a squash, ``solve`` a mesh, ``estimate``
its error, ``adapt`` how to get below a tolerance, ``shape`` the clay at the end.
"""
