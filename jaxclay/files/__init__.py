"""In and out.

``profiles``: contours that are ``packaged`` or in files, or in ``several`` of them, read by way of
``reading`` (bytes to cells), ``columns`` and ``headers`` (which is height, which radius), ``cells``
(cells to numbers) and ``units``.  ``piece``: clay with all that is needed to go on, each
``stroke`` of it, as JSON, which ``checked`` takes apart.  ``mesh``: bodies to print.
``replacing``: files that appear whole or not at all.  ``svg``: outlines to print.  ``plots``:
pictures (Matplotlib).  ``output``: what is printed, which may not reach anybody.

It may import every room from ``numerics`` to ``solve``, and Matplotlib late.
"""
