"""A page opened in headless Chromium, offline: what it asks for, what it complains of."""

import contextlib
import os
import shutil
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

_NAMES = ("chromium", "chromium-browser", "google-chrome")
_QUIET = (
    "--headless", "--no-sandbox", "--disable-gpu", "--disable-quic", "--no-first-run",
    "--disable-background-networking", "--disable-component-update", "--disable-sync",
)  # fmt: skip
_LATE = 400.0  # seconds after which what waits for a browser fails; moving its mouse knows no limit


def chromium() -> str:
    """The browser's path; the test is skipped without one, and in CI, where one belongs, fails."""
    found = next(filter(None, map(shutil.which, _NAMES)), None)
    if found is None:
        missing = f"none of {', '.join(_NAMES)} is there: apt-get install chromium"
        (pytest.fail if os.environ.get("CI") else pytest.skip)(missing)
    return found


@contextlib.contextmanager
def browser(*more: str) -> Iterator:
    """Playwright's browser of the Chromium that is installed, with more arguments if need be."""
    path = chromium()
    playwright = pytest.importorskip("playwright.sync_api")
    with playwright.sync_playwright() as running:
        opened = running.chromium.launch(executable_path=path, args=[*_QUIET, *more])
        late = threading.Timer(_LATE, _kill_chromium)
        late.start()
        try:
            yield opened
        finally:
            late.cancel()
            _kill_chromium()


def _kill_chromium() -> None:
    """End this process's browser at once: one that hangs answers no polite request either."""
    psutil = pytest.importorskip("psutil")
    for child in psutil.Process().children(recursive=True):
        with contextlib.suppress(psutil.NoSuchProcess):
            if "chrom" in child.name():
                child.kill()


@contextlib.contextmanager
def offline_page(file: Path) -> Iterator:
    """The page of a file; at the end it has asked for nothing else and complained of nothing.

    Every request but for files is blocked, and one of either kind beyond the page itself fails.
    """
    asked: list[str] = []
    complaints: list[str] = []
    address = file.resolve().as_uri()

    def decide(route) -> None:
        asked.append(route.request.url)
        if route.request.url.startswith("file://"):
            route.continue_()
        else:
            route.abort()

    with browser() as opened:
        page = opened.new_page()
        page.on("console", lambda said: complaints.append(said.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.route("**/*", decide)
        page.goto(address)
        yield page
    assert asked == [address]
    assert complaints == []
