"""Methods side by side (extra ``compare``).

``scenes``: what is solved.  ``plan``: by which methods, on which slices.  ``runner``: rows, one an
answer; each method's ladder of settings.  ``clock``: times.  ``results``, ``charts``, ``report``:
what comes out.  ``peers``: solvers from outside.  ``population``, ``accuracy``: random scenes, and
speed against accuracy on them.
"""
