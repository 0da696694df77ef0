"""The studio, each figure beside its bound.

Parts:
  a  from a move of the pointer to the new contour, measured inside the page
  b  new contours a second while dragging, in JupyterLab and Notebook 7
  c  from the command to a page that is ready, with JAX's compilations kept and from nothing
  d  200 strokes of one session, three materials: steps that converged, compilations
  e  random squashes in one modeller: errors, memory, r0, the lower bound
Times are those of a machine where ten million additions in a Python loop take 0.5 s.
"""

from __future__ import annotations

import contextlib
import os
import resource
import shutil
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from bounds import Bound, Part, at_least, at_most, run, table

from jaxclay.clay.clay import Clay
from jaxclay.files.stroke import Stroke
from jaxclay.model.material import Material
from jaxclay.solve.certified_newton import program
from jaxclay.studio import drawing
from jaxclay.studio.modeller import Modeller
from jaxclay.studio.solving import Compilations
from jaxclay.studio.starts import MATERIAL, STARTS

_SECONDS = 0.5  # of ten million additions, where the bounds hold
_ARGUMENTS = (  # WebGL without a GPU too; all else as Chromium does it by itself
    "--headless", "--no-sandbox", "--disable-quic", "--no-first-run", "--enable-unsafe-swiftshader",
    "--disable-background-networking",
)  # fmt: skip
_LISTEN = """window.shapes = []; document.addEventListener('jaxclay-shape',
    (event) => window.shapes.push([event.detail.ms, event.detail.solve]));"""
MATERIALS = {
    "the studio's": MATERIAL,
    "snake": Material.from_snake_units(),
    "30 times snake, mu .5": Material.from_snake_units(mu=0.5, alpha=30.0, beta=30.0),
}


class Effort(NamedTuple):
    """How thoroughly to measure."""

    seconds: float  # of dragging
    strokes: int
    squashes: int
    starts: int


QUICK, THOROUGH = Effort(3, 30, 300, 1), Effort(20, 200, 20_000, 3)


def slowness() -> float:
    """How many times slower this machine is now than that of the bounds.

    The loop runs as a script's own lines do: a function's would take half the time.
    """
    loop = compile("total = 0\nfor i in range(10_000_000):\n    total += i", "loop", "exec")
    begin = time.perf_counter()
    exec(loop, {})
    return (time.perf_counter() - begin) / _SECONDS


@contextlib.contextmanager
def command(*given: str, cache: str) -> Iterator[str]:
    """``jaxclay studio``, its address."""
    environment = os.environ | {"XDG_CACHE_HOME": cache}
    environment.pop("JAX_COMPILATION_CACHE_DIR", None)
    process = subprocess.Popen(
        [sys.executable, "-m", "jaxclay", "studio", *given], stdout=subprocess.PIPE, text=True,
        env=environment,
    )  # fmt: skip
    try:
        assert process.stdout is not None
        yield process.stdout.readline().split()[2]
    finally:
        process.terminate()
        process.wait(20)


@contextlib.contextmanager
def chromium() -> Iterator[Any]:
    """An empty page."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as playwright:
        path = shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=path, args=list(_ARGUMENTS))
        yield browser.new_page(viewport={"width": 1200, "height": 800})
        browser.close()


def drag(page: Any, seconds: float) -> np.ndarray:
    """(m, 2) ms of each new contour from its move, and ms of its solve, while dragging."""
    box = page.locator(".jc .stage").bounding_box()
    x, y, tall = box["x"] + 0.8 * box["width"], box["y"] + box["height"] / 2, box["height"]
    page.evaluate(_LISTEN)
    page.mouse.move(x, y)
    page.mouse.down()
    begin = time.perf_counter()
    while (gone := time.perf_counter() - begin) < seconds:
        turn = 2 * np.pi * gone / 4
        inwards = 0.19 + 0.02 * min(gone / seconds, 1) + 0.01 * np.cos(3 * turn)
        page.mouse.move(x - inwards * tall * min(gone, 1), y - 0.15 * tall * np.sin(turn))
        time.sleep(0.001)  # the browser takes one a frame
    page.mouse.up()
    page.wait_for_timeout(500)
    return np.array(page.evaluate("window.shapes")).reshape(-1, 2)


def latency(effort: Effort) -> Part:
    """Part a."""
    found = table("a. From the pointer's move to the new contour, ms", "", "median", "95%")
    with (
        tempfile.TemporaryDirectory() as cache,
        command(cache=cache) as address,
        chromium() as page,
    ):
        page.goto(address)
        page.get_by_text("ready", exact=True).wait_for(timeout=120_000)
        slow = slowness()
        shapes = drag(page, effort.seconds)
    bounds = []
    for what, values, most in (
        ("beside the solve", shapes[:, 0] - shapes[:, 1], (3.0, 8.0)),
        ("with the solve", shapes[:, 0], (5.0, 12.0)),
    ):
        median, high = np.quantile(values, [0.5, 0.95]) / slow
        found.add_row(what, f"{median:.1f}", f"{high:.1f}")
        bounds.append(at_most(f"{what}, median", median, most[0], unit=" ms"))
        bounds.append(at_most(f"{what}, 95%", high, most[1], unit=" ms"))
    return Part(found, bounds, [f"{len(shapes)} contours, {slow:.2f} times slower than 0.5 s"])


def jupyter(effort: Effort) -> Part:
    """Part b."""
    from studio_jupyter import notebook

    found = table("b. New contours a second while dragging", "", "a second")
    bounds = []
    for name, path in (("JupyterLab", "lab/tree"), ("Notebook 7", "notebooks")):
        with notebook(path) as address, chromium() as page:
            page.goto(address)
            cell = page.locator(".jp-CodeCell").first
            cell.wait_for(timeout=120_000)
            page.locator(".jp-Notebook-ExecutionIndicator[data-status=idle]").wait_for()
            page.wait_for_timeout(2000)  # or the cell is lost where the kernel is not connected yet
            cell.locator(".cm-content").click()
            page.keyboard.press("Shift+Enter")
            page.locator(".jc .pill").get_by_text("ready", exact=True).wait_for(timeout=120_000)
            slow = slowness()
            rate = len(drag(page, effort.seconds)) / effort.seconds * slow
        found.add_row(name, f"{rate:.0f}")
        bounds.append(at_least(f"{name}, contours a second", rate, 40.0, "{:.0f}"))
    return Part(found, bounds, [])


def readiness(effort: Effort) -> Part:
    """Part c."""
    found = table("c. From the command to a page that is ready, s", "compilations", "median")
    taken: dict[str, list[float]] = {"kept": [], "none": []}
    for _ in range(effort.starts):
        with tempfile.TemporaryDirectory() as cache:
            for kind in ("none", "kept"):
                with chromium() as page, contextlib.ExitStack() as processes:
                    slow, begin = slowness(), time.perf_counter()
                    page.goto(processes.enter_context(command(cache=cache)))
                    page.locator(".pill.good").wait_for(timeout=120_000)
                    taken[kind].append((time.perf_counter() - begin) / slow)
                    page.get_by_text("ready", exact=True).wait_for(timeout=120_000)
    bounds = []
    for kind, most in (("kept", 2.0), ("none", 8.0)):
        median = float(np.median(taken[kind]))
        found.add_row(kind, f"{median:.1f}")
        bounds.append(at_most(f"ready, compilations {kind}", median, most, "{:.1f}", " s"))
    return Part(found, bounds, [])


def random_stroke(rng: np.random.Generator, modeller: Modeller, kind: str = "press") -> Stroke:
    """In, along and out again, somewhere on the piece."""
    clay, unit = modeller.clay, float(modeller.clay.unit)
    height = rng.uniform(0.02, 1) * float(clay.height)
    radius = float(clay.radius_at(height))
    inner, away = radius * rng.uniform(0.75, 0.97), height + rng.uniform(-0.3, 0.3) * unit
    path = [(height, radius + 0.02 * unit), (height, inner), (away, inner), (away, 2 * radius)]
    return Stroke("right", 0.3 * unit, rng.uniform(0.05, 0.2) * unit, tuple(path), kind)


def strokes(effort: Effort) -> Part:
    """Part d."""
    found = table("d. Strokes of one session", "material", "steps", "refused", "longest, ms")
    Compilations().run()
    compiled = program.whole._cache_size()
    steps = refused = 0
    pressing = drawing.press
    for name, material in MATERIALS.items():
        answers, taken = [], []

        def counted(solver, *given, answers=answers, taken=taken):
            begin = time.perf_counter()
            answers.append(drawing.is_certified(answer := pressing(solver, *given), solver))
            taken.append(time.perf_counter() - begin)
            return answer

        rng, modeller = np.random.default_rng(7), Modeller(STARTS["cylinder"](), material)
        with _instead(drawing, "press", counted):
            for i in range(effort.strokes):
                modeller.draw(random_stroke(rng, modeller, "smooth" if i % 5 == 4 else "press"))
                if i % 20 == 19:
                    modeller.open(list(STARTS.values())[(i // 20) % len(STARTS)]())
        lost = answers.count(False)
        steps, refused = steps + len(answers), refused + lost
        found.add_row(name, f"{len(answers)}", f"{lost}", f"{1e3 * max(taken):.0f}")
    share = 1 - refused / steps
    more = program.whole._cache_size() - compiled
    bounds = [
        Bound("steps converged", ">= 99.9%", f"{share:.2%} of {steps}", share >= 0.999),
        at_most("compilations after ready", more, 0, "{:d}"),
    ]
    return Part(found, bounds, [])


def squashes(effort: Effort) -> Part:
    """Part e."""
    found = table("e. Random squashes in one modeller", "squashes", "refused", "MiB grown")
    Compilations().run()
    rng, modeller = np.random.default_rng(8), Modeller(Clay.cylinder(0.36))
    r0, least, refused, settled = float(modeller.clay.r0), np.inf, 0, 0.0
    for i in range(effort.squashes):
        before = modeller.clay
        height = rng.uniform(0, 1) * float(before.height)
        radius = float(before.radius_at(height)) * rng.uniform(0.8, 0.98)
        face = rng.uniform(0.05, 0.3)
        path = ((height, radius + 0.01), (height, radius))
        reading = modeller.draw(Stroke("right", max(face, 0.3), face, path))
        refused += not reading.certified
        assert float(modeller.clay.r0) == r0
        assert np.isfinite(modeller.clay.heights).all()
        least = min(least, float(modeller.clay.thickness.min()))
        if i % 40 == 39:
            modeller.open(Clay.cylinder(0.36))
        if i == effort.squashes // 4:
            settled = _resident()
    grown = _resident() - settled
    found.add_row(f"{effort.squashes}", f"{refused}", f"{grown:.0f}")
    bounds = [
        at_most("memory grown after a quarter of them", grown, 30.0, "{:.0f}", " MiB"),
        Bound("thicknesses", "above 0", f"{least:.2g}", least > 0),
    ]
    return Part(found, bounds, ["errors and a changed r0 would have ended it"])


@contextlib.contextmanager
def _instead(module: Any, name: str, value: Any) -> Iterator[None]:
    before = getattr(module, name)
    setattr(module, name, value)
    try:
        yield
    finally:
        setattr(module, name, before)


def _resident() -> float:
    """MiB that the process holds now."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 2**20


PARTS = {"a": latency, "b": jupyter, "c": readiness, "d": strokes, "e": squashes}

if __name__ == "__main__":
    raise SystemExit(run(PARTS, QUICK, THOROUGH, __doc__ or ""))
