"""What the paper asks, whatever the unknowns (eqs. 4-19).

``material``: the energy's constants.  ``squash``: the tool.  ``side``: E_move's least value on one
side of the band, in closed form.  ``band``: which clay the tool holds.  ``energy``: the energy's
densities and their sums.

It may import ``numerics`` and ``clay``.
"""
