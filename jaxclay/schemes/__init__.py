"""How a squash becomes an optimisation problem: unknowns, what is fixed, sums of the energy.

    slices   heights at nodes of which the band's edges are some: second order, the default
    paper    heights at equal steps of the clay (eqs. 20-22): first order, what 1993 computed
    spline   a B-spline of the displacement: an independent check

``base``: what every scheme gives to the methods.  ``posing``: :func:`jaxclay.pose`.  ``sums``,
``problem``, ``system``, ``folding``: what both schemes in heights share.  ``rough``: the sliced
cylinder model's shape.  ``energies``: E_total and its terms.  ``resolution``: how many slices
float64 resolves.

It may import ``numerics``, ``clay`` and ``model``.
"""
