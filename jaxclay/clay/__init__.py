"""The piece: nodes u_i, heights Y_i, radii that follow from constant volume (eqs. 1-3, 22).

``clay``: what a Clay is, and the same on other nodes.  ``slicing``: a profile cut into slices of
equal volume.  ``contour``: the polyline in space, and how far two are apart.  ``text``, ``html``:
what ``repr`` and notebooks say.

It may import ``numerics``.
"""
