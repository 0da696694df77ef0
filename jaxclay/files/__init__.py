"""In and out.

``profiles``: CSV and the packaged profiles.  ``piece``: clay with all that is needed to go on, as
JSON.  ``replacing``: files that appear whole or not at all.  ``units``: of length.  ``tables``: CSV
of numbers.  ``svg``: outlines to print.  ``plots``: pictures (Matplotlib).  ``output``:
what is printed, which may not reach anybody.

It may import every room from ``numerics`` to ``solve``, and Matplotlib late.
"""
