"""Experiments over many scenes (extras ``compare`` and ``sweep``).

    compare   methods side by side on named scenes: table, charts, report; load what a sweep found
    atlas     which method solves which scene, and how the others fail
    sweep     one TOML file in; results, charts and a report out

They may import every room but ``cli``, and pandas, pyarrow, rich, pydantic and dask late.
"""
