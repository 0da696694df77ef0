"""In and out.

``profiles``: CSV and the packaged profiles, written whole or not at all.  ``tables``: CSV of
numbers.  ``svg``: outlines to print.  ``plots``: pictures (Matplotlib).  ``output``:
what is printed, which may not reach anybody.

It may import every room from ``numerics`` to ``solve``, and Matplotlib late.
"""
