"""The widget in JupyterLab and Notebook 7: dragged there, its kernel killed, its piece restored."""

import contextlib
import os
import re
import signal
import subprocess
import sys
import time

import nbformat
import pytest
from browser import browser

pytest.importorskip("anywidget")
jupyterlab = pytest.importorskip("jupyterlab")

CODE = "import jaxclay.studio\nstudio = jaxclay.studio.Studio()\nstudio"
SAID = """import os
print('radius', studio.clay.radii.min(), 'strokes', len(studio.modeller.piece.strokes),
      'process', os.getpid())"""
WEBGL = "--enable-unsafe-swiftshader"


@pytest.fixture(scope="module")
def server(tmp_path_factory):
    """JupyterLab on a free port, at an address, with one notebook."""
    folder = tmp_path_factory.mktemp("jupyter")
    cells = [nbformat.v4.new_code_cell(text) for text in (CODE, SAID)]
    nbformat.write(
        nbformat.v4.new_notebook(
            metadata={"kernelspec": {"name": "python3", "display_name": "Python 3"}}, cells=cells
        ),
        folder / "clay.ipynb",
    )
    command = [
        sys.executable, "-m", "jupyterlab", "--no-browser", "--ServerApp.port=0", "--allow-root",
        "--IdentityProvider.token=", "--ServerApp.password=", f"--ServerApp.root_dir={folder}",
        "--LabApp.news_url=None",
    ]  # fmt: skip
    environment = os.environ | {"JUPYTER_CONFIG_DIR": str(folder / "config")}
    log = folder / "log.txt"  # a pipe that nobody reads would stop the server
    with log.open("w") as file, subprocess.Popen(
        command, stderr=file, env=environment, start_new_session=True
    ) as process:  # fmt: skip
        deadline = time.monotonic() + 60
        while not (found := re.search(r"(http://\S+?:\d+)/lab", log.read_text())):
            assert process.poll() is None, log.read_text()
            assert time.monotonic() < deadline, log.read_text()
            time.sleep(0.05)
        yield found[1]
        os.killpg(process.pid, signal.SIGKILL)  # with its kernels


def run_cell(page, index):
    page.locator(".jp-CodeCell").nth(index).locator(".cm-content").click()
    page.keyboard.press("Shift+Enter")


def drag(page):
    box = page.locator(".jc .stage").bounding_box()
    x, y, tall = box["x"] + 0.82 * box["width"], box["y"] + 0.5 * box["height"], box["height"]
    page.mouse.move(x, y)
    page.mouse.down()
    for i in range(1, 21):
        page.mouse.move(x - 0.012 * tall * i, y)
        page.wait_for_timeout(20)
    page.mouse.up()
    page.locator(".jc .stage[aria-busy=false]:not(.drag)").wait_for(timeout=30_000)


def reading(page):
    """What the second cell prints of the piece in Python."""
    run_cell(page, 1)
    output = page.locator(".jp-CodeCell").nth(1).locator(".jp-OutputArea-output")
    deadline = time.monotonic() + 20
    while time.monotonic() < deadline:
        said = output.inner_text() if output.count() else ""
        if found := re.search(r"radius (\S+) strokes (\d+) process (\d+)", said):
            return float(found[1]), int(found[2]), int(found[3])
        page.wait_for_timeout(100)
    raise AssertionError("the second cell prints nothing")


@contextlib.contextmanager
def opened(server, path):
    complaints = []
    with browser(WEBGL) as chromium:
        page = chromium.new_page(viewport={"width": 1400, "height": 1000}, reduced_motion="reduce")
        # Of the module, which is loaded as a blob; the front ends complain of their own affairs.
        page.on("pageerror", lambda error: complaints.append(error.stack))
        asked = []
        page.on("request", lambda request: asked.append(request.url))
        page.goto(f"{server}/{path}/clay.ipynb")
        page.locator(".jp-CodeCell").first.wait_for(timeout=60_000)
        page.locator(".jp-Notebook-ExecutionIndicator[data-status=idle]").wait_for(timeout=60_000)
        page.wait_for_timeout(2000)
        yield page
        assert [stack for stack in complaints if "blob:" in (stack or "")] == []
        assert all(url.startswith((server, "data:", "blob:", "ws://127")) for url in asked
                   if "localhost" not in url)  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("path", ["lab/tree", "notebooks"], ids=["JupyterLab", "Notebook 7"])
def test_the_widget_is_dragged_undone_and_survives_its_kernel(server, path):
    with opened(server, path) as page:
        run_cell(page, 0)
        page.locator(".jc .pill.good").wait_for(timeout=90_000)
        drag(page)
        radius, strokes, process = reading(page)
        assert radius < 0.35
        assert strokes == 1
        page.get_by_role("button", name="Undo the last stroke").click()
        page.locator(".jc .stage[aria-busy=false]").wait_for(timeout=20_000)
        page.get_by_role("button", name="Redo").click()
        page.locator(".jc .stage[aria-busy=false]").wait_for(timeout=20_000)
        os.kill(process, signal.SIGKILL)
        page.locator("dialog").get_by_role("button", name="Ok", exact=True).click(timeout=30_000)
        page.get_by_role("button", name="Undo the last stroke").click()
        page.get_by_role("alert").get_by_text("No answer").wait_for(timeout=15_000)
        page.wait_for_timeout(1000)
        run_cell(page, 0)
        page.get_by_role("button", name="Restore it").click(timeout=60_000)
        page.locator(".jc .pill.good").last.wait_for(timeout=90_000)
        page.locator(".jc .stage[aria-busy=false]").last.wait_for(timeout=20_000)
        again, *_ = reading(page)
        assert again == pytest.approx(radius, rel=1e-12)
