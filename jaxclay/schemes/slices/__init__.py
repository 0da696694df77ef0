"""Scheme "slices": the paper's unknowns at second order, with the tool's edge in its place.

Eq. 21 with eq. 22 lets the last slice under the tool stand for the tool's edge: its middle is half
a slice early, and the edge itself is rounded down to a node.  That alone makes the paper's sums
first order in 1/n.  Here nodes lie anywhere, the band's edges are nodes, and the edge enters the
differences as a point of its own, with X = x0 and, through the clay under the tool beside it,
X_u = 0.

``locate``, ``sides``, ``moments``: the band of least E_move on the smooth rest shape.  ``density``,
``nodes``: where slices go.  ``weights``: the sums.  ``posing``: the problem.  ``edges``: which
edges of tools an answer's contour has.
"""
