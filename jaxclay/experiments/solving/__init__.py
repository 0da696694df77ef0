"""A task solved: the work of one worker.

``solve``: a batch of tasks to rows.  ``clock``: times.  ``budget``: so many seconds for a solve.
``references``: the minima that answers are measured from.  ``batched``: many in one compiled call.
``rows``, ``where``: columns.
"""
