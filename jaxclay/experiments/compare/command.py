"""``jaxclay compare``: plan, run with a progress bar, print, write."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from pathlib import Path

try:
    import pyarrow  # noqa: F401  # pandas asks for it when everything has been measured
    from threadpoolctl import threadpool_limits

    from jaxclay.experiments.compare import report, results
    from jaxclay.experiments.compare.progress import fit, plain_console, progress_bar
except ImportError as error:
    raise ImportError(
        f"jaxclay compare needs {error.name}: pip install 'jaxclay[compare]'", name=error.name
    ) from error

from jaxclay.experiments.compare.peers import PEERS, checked
from jaxclay.experiments.compare.plan import DEFAULT_METHODS, Plan
from jaxclay.experiments.compare.runner import Overlay, Row, run
from jaxclay.experiments.compare.scenes import (
    NAMED,
    Scene,
    folder_scenes,
    packaged_scenes,
    with_move,
)
from jaxclay.methods import METHODS

_QUICK_SCENES = ("reference", "fig6", "teapot", "amphora")
_MOST_SLICES = 1024  # dense methods


def compare(
    out: Path,
    scenes: list[str] | None = None,
    methods: list[str] | None = None,
    slices: list[int] | None = None,
    profiles: Path | None = None,
    quick: bool = False,
    minimum_radius: float | None = None,
    peers: list[str] | None = None,
    interrupt: Callable[[], None] = lambda: None,
) -> int:
    """Run the comparison; 0, or 130 if it was interrupted and only a part was written.

    ``interrupt`` is called between solves and may raise KeyboardInterrupt.
    ``peers`` names solvers from outside that run too; an empty list is all of them.

    Raises
    ------
    ValueError
        An unknown scene, method or peer, too few or too many slices, no CSV in the folder.
    ImportError
        A peer's library is missing.
    """
    plan = make_plan(scenes, methods, slices, profiles, quick, minimum_radius, peers)
    out.mkdir(parents=True, exist_ok=True)
    tempfile.TemporaryFile(dir=out).close()  # a folder that refuses should do so now
    rows: list[Row] = []
    overlays: list[Overlay] = []
    interrupted = False
    try:
        # Dense factorisations are small: more threads only wait for each other.
        with threadpool_limits(1):
            _run(plan, rows, overlays, interrupt)
    except KeyboardInterrupt:
        interrupted = True
    console = plain_console()
    if not any(row["status"] != "skipped" for row in rows):
        console.print("nothing was measured; nothing is written")
        return 130 if interrupted else 1
    table = results.frame(rows)
    written = [results.save(table, out), *report.write(table, overlays, out)]
    results.print_table(table, console)
    for line in results.skipped(table):
        console.print(f"skipped {line}", highlight=False, soft_wrap=True)
    if interrupted:
        console.print("interrupted: what had been measured is written")
    console.print(f"wrote {len(written)} files to {out}, among them report.html", soft_wrap=True)
    return 130 if interrupted else 0


def make_plan(
    scenes: list[str] | None,
    methods: list[str] | None,
    slices: list[int] | None,
    profiles: Path | None,
    quick: bool,
    minimum_radius: float | None = None,
    peers: list[str] | None = None,
) -> Plan:
    """The default plan, narrowed or widened as asked.

    With peers the named scenes are run as E_move alone too, for those that take nothing else.
    """
    known = packaged_scenes()
    added = folder_scenes(profiles, minimum_radius) if profiles else {}
    chosen = _choose("scene", scenes, known | added)
    if scenes is None and quick:
        chosen = [known[name] for name in _QUICK_SCENES] + list(added.values())
    names = methods or list(DEFAULT_METHODS)
    for name in names:
        if name not in METHODS:
            raise ValueError(f"unknown method {name!r}: choose from {', '.join(METHODS)}")
    outside = list(PEERS) if peers == [] else peers or []
    for name in outside:
        checked(name)  # imports it too, before threads are limited
    if outside:
        chosen = [with_move(scene) if scene.name in NAMED else scene for scene in chosen]
    grids = slices or ([64] if quick else [64, 128])
    for n in grids:
        if not 8 <= n <= _MOST_SLICES:
            raise ValueError(f"slices must lie between 8 and {_MOST_SLICES}, got {n}")
    # The reference's band ends on a node of all these grids, so that its errors fall in order.
    wanted = ("reference",) if quick else ("reference", "amphora")
    names_chosen = [scene.name for scene in chosen]
    featured = frozenset(name for name in wanted if name in names_chosen) or names_chosen[:1]
    return Plan(
        scenes=chosen,
        methods=names,
        peers=outside,
        slices=sorted(set(grids)),
        grids=[32, 64, 128] if quick else [32, 64, 128, 256],
        finest=256 if quick else 512,
        on_grids=frozenset(featured),
        on_ladders=frozenset(featured),
        repeats=3 if quick else 5,
    )


def _choose(kind: str, names: list[str] | None, known: dict[str, Scene]) -> list[Scene]:
    for name in names or ():
        if name not in known:
            raise ValueError(f"unknown {kind} {name!r}: choose from {', '.join(known)}")
    return [known[name] for name in names] if names else list(known.values())


def _run(plan: Plan, rows: list[Row], overlays: list[Overlay], interrupt) -> None:
    with progress_bar() as progress:
        task = progress.add_task("", total=len(plan.jobs()) * len(plan.contestants))

        def tick(what: str) -> None:
            interrupt()
            progress.update(task, description=fit(what))

        for row, overlay in run(plan, tick):
            rows.append(row)
            if overlay is not None:
                overlays.append(overlay)
            if row["experiment"] in ("answer", "grid"):
                progress.advance(task)
        progress.update(task, description=fit("done"))
