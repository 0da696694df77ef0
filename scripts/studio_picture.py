"""Write notebooks/images/studio.png, the studio's page with a tool at a vase, for the README."""

from __future__ import annotations

import io
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from PIL import Image
from playwright.sync_api import sync_playwright

from jaxclay.clay.clay import Clay
from jaxclay.files.piece import save_piece
from jaxclay.files.stroke import Stroke
from jaxclay.studio.modeller import Modeller

_PICTURE = Path(__file__).resolve().parents[1] / "notebooks" / "images" / "studio.png"
_ARGUMENTS = (
    "--headless", "--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)  # fmt: skip


def vase() -> Modeller:
    """A neck, a shoulder and a foot, smoothed."""
    modeller = Modeller(Clay.cylinder(0.34))
    ways = [
        ("press", 0.14, [(0.95, 0.36), (0.95, 0.2), (0.84, 0.19), (0.80, 0.26), (0.80, 0.5)]),
        ("press", 0.10, [(0.06, 0.36), (0.06, 0.24), (0.16, 0.25), (0.3, 0.31), (0.3, 0.5)]),
        ("press", 0.10, [(0.93, 0.34), (0.93, 0.15), (0.88, 0.14), (0.88, 0.5)]),
        ("smooth", 0.3, [(1.0, 0.2), (0.7, 0.26), (0.2, 0.26)]),
        ("smooth", 0.3, [(1.0, 0.2), (0.7, 0.26), (0.2, 0.26)]),
    ]
    for kind, face, path in ways:
        modeller.draw(Stroke("right", max(face, 0.3), face, tuple(path), kind))
    return modeller


def main() -> int:
    """Draw it; 1 if the file is larger than a README should load."""
    with tempfile.TemporaryDirectory() as folder:
        piece = Path(folder) / "vase.json"
        save_piece(piece, vase().piece)
        process = subprocess.Popen(
            [sys.executable, "-m", "jaxclay", "studio", str(piece)],
            stdout=subprocess.PIPE, text=True,
        )  # fmt: skip
        try:
            assert process.stdout is not None
            shot = shown(process.stdout.readline().split()[2])
        finally:
            process.terminate()
            process.wait(20)
    image = Image.open(io.BytesIO(shot)).convert("RGB").quantize(256)
    image.save(_PICTURE, optimize=True)
    print(f"wrote {_PICTURE}, {_PICTURE.stat().st_size / 1000:.0f} kB")
    return int(_PICTURE.stat().st_size > 300_000)


def shown(address: str) -> bytes:
    """The page while the tool is pressed against the shoulder."""
    with sync_playwright() as playwright:
        path = shutil.which("chromium")
        browser = playwright.chromium.launch(executable_path=path, args=list(_ARGUMENTS))
        page = browser.new_page(viewport={"width": 1120, "height": 800}, color_scheme="light")
        page.goto(address)
        page.get_by_text("ready", exact=True).wait_for(timeout=120_000)
        page.wait_for_timeout(1500)
        box = page.locator(".stage").bounding_box()
        assert box is not None
        x, y, tall = box["x"] + 0.8 * box["width"], box["y"] + 0.5 * box["height"], box["height"]
        page.mouse.move(x, y)
        page.mouse.down()
        for i in range(1, 21):
            page.mouse.move(x - 0.0085 * tall * i, y + 0.002 * tall * i)
            page.wait_for_timeout(25)
        page.wait_for_timeout(1500)
        shot = page.screenshot()
        browser.close()
    return shot


if __name__ == "__main__":
    sys.exit(main())
