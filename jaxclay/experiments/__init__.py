"""Experiments over many scenes (extras ``compare`` and ``sweep``).

    compare   methods side by side on named scenes: table, charts, report
    atlas     which method solves which scene, and how the others fail
    sweep     one TOML file in; results, charts and a report out: :func:`run`, :func:`load`

They may import every room but ``cli``, and pandas, pyarrow, rich, pydantic and dask late.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

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
        TOML file; :mod:`jaxclay.experiments.sweep.tables` lists its keys.
    out : str or path
        Folder that keeps the results; a run that was stopped goes on there.
    backend : str
        "serial", "processes" or "dask".  With "processes" a script has to guard what it runs by
        ``if __name__ == "__main__"``, as each process reads it too.
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
    from jaxclay.experiments.sweep import engine
    from jaxclay.experiments.sweep.experiment import experiment_path, read_experiment
    from jaxclay.experiments.sweep.store import keep_experiment

    whole = read_experiment(experiment, profiles)
    engine.check_backend(whole, backend, scheduler)
    keep_experiment(Path(out), experiment_path(experiment))
    engine.run(whole, Path(out), backend, scheduler)
    return load(out)


def load(folder: str | Path) -> pandas.DataFrame:
    """The results of a folder that ``jaxclay sweep`` filled (extra ``sweep``).

    Parameters
    ----------
    folder : str or path
        What was given as ``--out``.

    Returns
    -------
    pandas.DataFrame
        A row for each task that is done, each once.  ``frame.attrs["units"]`` says of every
        column what it is and in which unit; so does
        :data:`jaxclay.experiments.sweep.columns.COLUMNS`.

    Raises
    ------
    ValueError
        There are no results in the folder.
    """
    from jaxclay.experiments.sweep.load import table

    return table(folder)


def load_curves(folder: str | Path) -> xarray.Dataset:
    """Contours and traces of the same results.

    Returns
    -------
    xarray.Dataset
        ``contour_height`` and ``contour_radius`` (task, point), in the clay's length unit from
        bottom to top; ``trace_iterations``, ``trace_s`` in seconds and ``trace_energy``
        (task, stop) of methods with stops.  Shorter rows end in NaN.  Keys, scenes, schemes and
        methods are coordinates of the dimension task.

    Raises
    ------
    ValueError
        There are no results in the folder.
    """
    from jaxclay.experiments.sweep.load import curves

    return curves(folder)
