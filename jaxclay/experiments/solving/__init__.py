"""A task solved: the work of one worker.

``solve``: a batch of tasks to rows.  ``clock``: times, and so many seconds for a solve.
``references``: the minima that answers are measured from.
"""
