"""In and out.

``profiles``: CSV and the packaged profiles, written whole or not at all.  ``tables``: CSV of
numbers.  ``svg``: outlines to print.  ``plots``: pictures (Matplotlib).

It may import every room from ``numerics`` to ``solve``, and Matplotlib late.
"""
