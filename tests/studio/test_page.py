"""The page in Chromium: dragged, undone, exported, cut off and connected again."""

import io

import numpy as np
import pytest
from browser import browser
from PIL import Image
from served import serving

from jaxclay.clay.clay import Clay

WEBGL = "--enable-unsafe-swiftshader"
UNNAMED = """
const get = WebGL2RenderingContext.prototype.getExtension;
WebGL2RenderingContext.prototype.getExtension = function (name) {
  return name === "WEBGL_debug_renderer_info" ? null : get.call(this, name);
};
"""  # as if by a GPU: nothing tells that it is software
NO_WEBGL = """
const get = HTMLCanvasElement.prototype.getContext;
HTMLCanvasElement.prototype.getContext = function (kind, ...more) {
  return kind === "webgl2" ? null : get.call(this, kind, ...more);
};
"""
NO_RAW_MOVES = "delete HTMLElement.prototype.onpointerrawupdate;"  # as from a host far away


@pytest.fixture(scope="module")
def chromium():
    with browser(WEBGL) as opened:
        yield opened


@pytest.fixture(scope="module")
def host(ready):
    with serving(ready, Clay.cylinder(0.36)) as found:
        yield found


@pytest.fixture
def tab(chromium, host):
    """Opens tabs of the page; none of them may complain, or ask beyond this machine."""
    contexts, complaints, asked = [], [], []

    def opened(width=1200, height=800, script="", **more):
        context = chromium.new_context(
            viewport={"width": width, "height": height}, reduced_motion="reduce", **more
        )
        contexts.append(context)
        page = context.new_page()
        page.on("console", lambda said: complaints.append(said.text))
        page.on("pageerror", lambda error: complaints.append(str(error)))
        page.on("request", lambda request: asked.append(request.url))
        if script:
            page.add_init_script(script)
        page.goto(host.address)
        page.locator(".pill.good").wait_for(timeout=30_000)
        return page

    host.studio.modeller.open(Clay.cylinder(0.36))
    yield opened
    for context in contexts:
        context.close()
    # Screenshots read pixels back, of which the driver of a software renderer tells.
    assert [text for text in complaints if "GL Driver Message" not in text] == []
    assert all(url.startswith((host.address, "data:", "blob:")) for url in asked)


def settled(page):
    """Wait until the page has had all its answers."""
    page.wait_for_timeout(80)
    page.locator(".stage[aria-busy=false]:not(.drag)").wait_for(timeout=20_000)


def drag(page, down=0.0, inwards=0.2, shift=False):
    """The tool, from where it stands, by parts of the stage's height."""
    box = page.locator(".stage").bounding_box()
    x, y, tall = box["x"] + 0.8 * box["width"], box["y"] + 0.5 * box["height"], box["height"]
    page.mouse.move(x, y)
    if shift:
        page.keyboard.down("Shift")
    page.mouse.down()
    for i in range(1, 13):
        page.mouse.move(x - inwards * tall * min(i / 6, 1), y + down * tall * max(i / 6 - 1, 0))
        page.wait_for_timeout(15)
    page.mouse.up()
    if shift:
        page.keyboard.up("Shift")
    settled(page)


def shows_clay(page):
    """Whether the middle of the stage is of clay's colour and not of the paper behind it."""
    shown = Image.open(io.BytesIO(page.locator(".stage").screenshot())).convert("RGB")
    red, _, blue = shown.getpixel((shown.width // 2, shown.height // 2))
    return red > blue + 40


@pytest.mark.parametrize(
    "script", ["", UNNAMED, NO_WEBGL, NO_RAW_MOVES], ids=["software", "WebGL2", "2D", "far"]
)
def test_dragging_shapes_the_clay_and_undo_gives_the_exact_contour_back(tab, host, script):
    page, clay = tab(900, 560, script), host.studio.clay
    drawn = page.evaluate("document.createElement('canvas').getContext('webgl2') !== null")
    assert drawn == (script != NO_WEBGL)
    raw = page.evaluate("'onpointerrawupdate' in document.querySelector('.stage')")
    assert raw == (script != NO_RAW_MOVES)
    assert any(shows_clay(page) for _ in range(50))  # a software renderer takes its time
    shot = page.locator(".stage").screenshot()
    drag(page)
    shaped = host.studio.clay
    assert shaped.radii.min() < 0.34
    assert shaped.r0 == clay.r0
    squares = np.sum(shaped.radii**2 * shaped.thickness)
    assert np.pi * squares == pytest.approx(np.pi * 0.36**2, rel=1e-12)
    assert page.locator(".stage").screenshot() != shot
    told = page.locator("dl").inner_text()
    assert f"{float(shaped.height):.4g}"[:5] in told
    page.keyboard.press("Control+z")
    settled(page)
    assert host.studio.clay.heights.tobytes() == clay.heights.tobytes()
    page.keyboard.press("Control+Shift+Z")
    settled(page)
    assert host.studio.clay is shaped
    page.get_by_role("button", name="Back to the start").click()
    settled(page)
    assert host.studio.clay.heights.tobytes() == clay.heights.tobytes()


def test_the_keyboard_does_what_the_mouse_does(tab, host):
    page, clay = tab(), host.studio.clay
    page.locator(".stage").focus()
    page.keyboard.press("s")
    for _ in range(24):
        page.keyboard.press("ArrowRight")  # the tool now comes from the left
    page.keyboard.press("Enter")
    settled(page)
    pressed = host.studio.clay
    assert pressed.radii.min() < 0.345
    assert host.studio.modeller.piece.strokes[-1].side == "left"
    for _ in range(4):
        page.keyboard.press("Shift+ArrowUp")
    page.keyboard.press("Enter")
    settled(page)
    assert host.studio.modeller.piece.strokes[-1].kind == "smooth"
    page.keyboard.press("ArrowRight")
    page.wait_for_timeout(60)
    page.keyboard.press("Escape")
    settled(page)
    assert len(host.studio.modeller.piece.strokes) == 2
    assert clay is not host.studio.clay


def test_exports_download_a_watertight_body_in_millimetres(tab, host):
    trimesh = pytest.importorskip("trimesh")
    page = tab()
    drag(page)
    for kind in ("stl", "obj", "glb"):
        page.get_by_label("Format to export").select_option(kind)
        with page.expect_download() as waiting:
            page.get_by_role("button", name="Export contour or body").click()
        assert waiting.value.suggested_filename == f"clay.{kind}"
        data = io.BytesIO(waiting.value.path().read_bytes())
        mesh = trimesh.load(data, file_type=kind, force="mesh")
        assert mesh.is_watertight
        assert mesh.volume == pytest.approx(float(host.studio.clay.volume) * 1e6, rel=1e-3)


def test_a_second_tab_shows_and_shapes_the_same_piece(tab, host):
    first, second = tab(), tab()
    drag(second)
    height = first.locator("dd").first.inner_text()
    assert height == second.locator("dd").first.inner_text()
    assert len(host.studio.modeller.piece.strokes) == 1
    first.get_by_role("button", name="Undo the last stroke").click()
    settled(first)
    assert host.studio.modeller.piece.strokes == ()
    assert second.get_by_role("button", name="Redo").is_enabled()


def test_a_piece_is_saved_and_opened_and_damage_is_refused(tab, host, tmp_path):
    page = tab()
    drag(page)
    shaped = host.studio.clay
    with page.expect_download() as waiting:
        page.get_by_role("button", name="Save the piece").click()
    path = tmp_path / "piece.json"
    waiting.value.save_as(path)
    page.get_by_role("button", name="Back to the start").click()

    def opened(file):
        with page.expect_file_chooser() as chooser:
            page.get_by_role("button", name="Open a saved piece").click()
        chooser.value.set_files(file)
        settled(page)

    opened(path)
    np.testing.assert_array_equal(host.studio.clay.heights, shaped.heights)
    damaged = tmp_path / "damaged.json"
    damaged.write_text(path.read_text()[:-100])
    opened(damaged)
    assert "damaged or cut off" in page.get_by_role("alert").inner_text()
    np.testing.assert_array_equal(host.studio.clay.heights, shaped.heights)


def test_it_wraps_at_600_pixels_and_follows_the_system_s_colours(tab):
    page = tab(600, 900, color_scheme="dark")
    assert page.evaluate("document.documentElement.scrollWidth") <= 600
    assert page.locator(".jc.dark.narrow").count() == 1
    assert page.locator(".stage").evaluate("node => getComputedStyle(node).touchAction") == "none"
    for button in page.locator("button").all():
        assert button.get_attribute("aria-label")


def test_touch_drags_the_tool(tab, host):
    page = tab(has_touch=True)
    box = page.locator(".stage").bounding_box()
    x, y = box["x"] + 0.8 * box["width"], box["y"] + box["height"] / 2
    session = page.context.new_cdp_session(page)
    for kind, at in [("touchStart", 0), *(("touchMove", 20 * i) for i in range(1, 12))]:
        points = [{"x": x - at, "y": y}]
        session.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})
        page.wait_for_timeout(15)
    session.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    settled(page)
    assert host.studio.clay.radii.min() < 0.345


def test_a_lost_connection_is_told_and_another_process_gets_the_piece(ready, chromium):
    page = chromium.new_page(reduced_motion="reduce")
    with serving(ready, Clay.cylinder(0.36)) as first:
        page.goto(first.address)
        page.locator(".pill.good").wait_for(timeout=30_000)
        drag(page)
        shaped, port = first.studio.clay, first.port
        assert shaped.radii.min() < 0.34
    page.get_by_role("alert").get_by_text("Connection lost").wait_for(timeout=10_000)
    with serving(ready, Clay.cylinder(0.36), port=port) as second:
        page.locator(".pill.good").wait_for(timeout=30_000)
        settled(page)
        np.testing.assert_array_equal(second.studio.clay.heights, shaped.heights)
        assert page.get_by_role("alert").count() == 0
    page.close()
