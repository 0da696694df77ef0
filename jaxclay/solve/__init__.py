"""Asking for a minimum: deform and minimize.

``minimize``: both.  ``refining``: on how many slices, and where they go.  ``start``, ``carried``:
initial guesses.  ``certified_newton``: the compiled program behind most answers.  ``certificate``:
how far an answer can be from its minimum; ``spline_certificate`` likewise for splines.
``solution``: the answer.  ``implicit``: derivatives of a minimum.  ``batch``: many at once.

It may import ``numerics``, ``clay``, ``model``, ``schemes`` and ``methods``.
"""
