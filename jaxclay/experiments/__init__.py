"""One engine for all experiments: a TOML file in; results, charts and a report out.

    file --entries--> Task --solving--> row --store--> parquet files --load--> charts, report

``jaxclay compare``, ``atlas``, ``sweep`` and ``agree`` are short ways to run files of the folder
``packaged``; :func:`run` and :func:`load` are the ways from Python (extra ``sweep``).

``entries``: what a file may say, and the tasks that it asks for.  ``solving``: a task to a row, by
one clock.  ``contestants``: methods, and ``peers`` from outside, behind one call.  ``engine``,
``backends``, ``store``, ``machine``: where tasks run and results are kept.  ``charts``,
``summary``, ``report``: what is read.  ``scenes``: the named ones.  ``agree``:
a verdict on rows.  The commands are in ``cli``.

It may import every room but ``cli``; pandas, pyarrow, rich, pydantic and dask late.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from jaxclay.numerics import checks

if TYPE_CHECKING:
    import pandas
    import xarray


def run(
    experiment: str | Path,
    out: str | Path,
    *,
    backend: str = "serial",
    scheduler: str | None = None,
    profiles: str | Path | None = None,
) -> pandas.DataFrame:
    """Run what is missing of an experiment file, as ``jaxclay sweep`` does (extra ``sweep``).

    Parameters
    ----------
    experiment : str or path
        TOML file; :mod:`jaxclay.experiments.entries.tables` lists its keys.
    out : str or path
        Folder that keeps the results; a run that was stopped goes on there.
    backend : str
        "serial", or "processes" or "dask", in a process a core, where a script has to guard what
        it runs by ``if __name__ == "__main__"``, as each process reads it too.
    scheduler : str, optional
        Address of an existing dask scheduler; if not given, a cluster here.
    profiles : str or path, optional
        Folder whose CSV files join the profiles of the file.

    Returns
    -------
    pandas.DataFrame
        All results of the folder: see :func:`load`.

    Raises
    ------
    ValueError
        What is wrong in the file, in which line; a backend that does not go with it.
    OSError
        The folder cannot be written to; what had been solved is kept.
    RuntimeError
        A worker died; what had been solved is kept.  Another timing run is under way.
    """
    with checks.needing("sweep", "jaxclay.experiments.run"):
        from jaxclay.experiments import engine
        from jaxclay.experiments.entries.reading import of_file
        from jaxclay.experiments.store import keep_experiment

    found = of_file(experiment, profiles)
    engine.check_backend(found.experiment, backend, scheduler)
    every = engine.tasks_of(found.experiment, backend)
    if engine.work(every, Path(out), backend).missing:
        keep_experiment(Path(out), found.name, found.text)
    engine.run(every, Path(out), backend, scheduler)
    return load(out)


def load(folder: str | Path) -> pandas.DataFrame:
    """The results of a folder, what was ``--out``, each task once (extra ``sweep``).

    ``frame.attrs["units"]`` says of every column what it is and in which unit; so does
    :data:`jaxclay.experiments.columns.COLUMNS`.  Raises ValueError where there are none.
    """
    with checks.needing("sweep", "jaxclay.experiments.load"):
        from jaxclay.experiments.results import table

    return table(folder)


def load_curves(folder: str | Path) -> xarray.Dataset:
    """Contours and traces of the same results; raises as :func:`load`.

    ``contour_height`` and ``contour_radius`` (task, point) are in the clay's length unit from
    bottom to top, and of timing runs the same ``before`` the squash and at the ``start``;
    ``trace_iterations``, ``trace_s`` in seconds and ``trace_energy`` (task, stop) are of methods
    with stops.  Shorter rows end in NaN.  Keys, scenes, schemes and methods are coordinates.
    """
    with checks.needing("sweep", "jaxclay.experiments.load_curves"):
        from jaxclay.experiments.results import curves

    return curves(folder)
