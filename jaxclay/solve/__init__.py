"""Asking for a minimum: deform and minimize.

``minimize``: both.  ``refining``: on how many slices, and where they go.  ``start``, ``carried``:
initial guesses.  ``certified_newton``: the compiled program behind most answers.  ``certificate``:
how far an answer of any scheme can be from its minimum.  ``solution``, ``html``: the answer.
``on_spans``: all that on splines.  ``implicit``, ``spline_derivative``: derivatives of a minimum.
``batch``: many at once.

It may import ``numerics``, ``clay``, ``model``, ``schemes`` and ``methods``.
"""
