import numpy as np
import oracles
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import SNAKE, piece

import jaxclay
from jaxclay import Clay, Squash, area_error, contour_error, load_profile, save_profile
from jaxclay.clay.contour import polyline
from jaxclay.files.profiles import loaded


def write(folder, text, name="contour.csv", **options):
    path = folder / name
    path.write_text(text, **options)
    return path


def test_teapot_goes_through_its_control_points():
    heights, radii = jaxclay.PROFILES["teapot"]()
    ends = {0.0: 1.5, 0.75: 2.0, 2.25: 1.5}  # the ends of Newell's two Bezier pieces
    for height, radius in ends.items():
        assert radii[np.argmin(np.abs(heights - height))] == pytest.approx(radius, rel=1e-12)
    assert heights.max() == 2.25
    # Half way along the lower piece: (P0 + 3 P1 + 3 P2 + P3) / 8.
    point = (0 + 3 * 0.075 + 3 * 0.3 + 0.75) / 8, (1.5 + 3 * 1.5 + 3 * 2 + 2) / 8
    assert np.min(np.hypot(heights - point[0], radii - point[1])) < 1e-12


@pytest.mark.parametrize("name", list(jaxclay.PROFILES))
def test_packaged_profiles_become_clay(name):
    clay = load_profile(name, slices=32)
    assert clay.slices == 32
    assert clay.height == clay.unit == jaxclay.PROFILES[name]()[0][-1]
    fine, error = loaded(name)
    assert fine.slices in (1024, 2048)
    assert error < 3e-5


def test_a_profile_is_cut_until_it_is_near_and_the_error_is_its_distance(tmp_path):
    text = "height,radius\n2,3\n3,4\n3.5,2\n5,2.5\n"
    path = write(tmp_path, text)
    clay, error = loaded(path)
    assert clay.slices == 2048  # corners are cut: of first order
    assert 1e-5 < error < 1e-3
    profile = np.array([[0, 0], [3, 0], [4, 1], [2, 1.5], [2.5, 3], [0, 3]])
    assert error == pytest.approx(oracles.hausdorff(polyline(clay), profile, 20_000) / 3, rel=0.2)
    assert loaded(path, 64).error > 10 * error
    straight = loaded(write(tmp_path, "height,radius\n0,1\n1,1\n"))
    assert straight.clay.slices == 64
    assert straight.error < 1e-12


def test_a_saved_file_says_what_other_slices_lose(tmp_path):
    clay = load_profile("amphora", 256)
    save_profile(clay, tmp_path / "a.csv")
    assert loaded(tmp_path / "a.csv").error == 0
    coarse = loaded(tmp_path / "a.csv", 64)
    assert coarse.error == contour_error(coarse.clay, clay) > 0


@pytest.mark.parametrize("slices", [0, 2, -5])
def test_too_few_slices_are_named(slices):
    with pytest.raises(ValueError, match=f"slices must be .* at least 3, got {slices}"):
        load_profile("bowl", slices=slices)


def test_unknown_name_lists_the_known_ones(tmp_path):
    with pytest.raises(ValueError, match="no profile 'kettle': choose from teapot, amphora, bowl"):
        load_profile("kettle")
    with pytest.raises(OSError, match=r"missing\.csv"):
        load_profile(tmp_path / "missing.csv")


def same_bits(a, b):
    for name in ("thickness", "radii", "r0", "unit", "heights"):
        np.testing.assert_array_equal(getattr(a, name), getattr(b, name), err_msg=name)


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), slices=st.integers(3, 80))
def test_csv_round_trip_keeps_every_bit(tmp_path_factory, seed, slices):
    path = tmp_path_factory.mktemp("csv") / "piece.csv"
    clay = piece(np.random.default_rng(seed).uniform(0.3, 3, slices), r0=0.3 + seed % 7)
    save_profile(clay, path)
    same_bits(load_profile(path), clay)


@pytest.mark.parametrize("name", list(jaxclay.PROFILES))
def test_csv_round_trip_of_packaged_profiles(tmp_path, name):
    clay = load_profile(name)
    save_profile(clay, tmp_path / "piece.csv")
    same_bits(load_profile(tmp_path / "piece.csv"), clay)


@pytest.mark.core
def test_csv_round_trip_of_squashed_clay(tmp_path):
    clay = jaxclay.deform(Clay.cylinder(), Squash(0.35, 0.6, 0.4), SNAKE, scheme="paper").clay
    save_profile(clay, tmp_path / "piece.csv")
    same_bits(load_profile(tmp_path / "piece.csv"), clay)


def test_written_columns_are_the_slices(tmp_path):
    clay = Clay.from_profile([0, 1], [1, 2], slices=4)
    save_profile(clay, tmp_path / "cone.csv")
    rows = np.genfromtxt(tmp_path / "cone.csv", delimiter=",", skip_header=3)
    middles = (clay.heights[1:] + clay.heights[:-1]) / 2
    np.testing.assert_array_equal(rows[1:-1, 0], middles)
    np.testing.assert_array_equal(rows[[0, -1], 0], [0, clay.height])
    assert np.sum(np.pi * rows[:, 1] ** 2 * rows[:, 2]) == pytest.approx(7 / 3 * np.pi, rel=1e-13)


def test_a_written_file_can_be_cut_anew(tmp_path):
    clay = Clay.from_profile([0, 1], [1, 2], slices=64)
    save_profile(clay, tmp_path / "cone.csv")
    again = load_profile(tmp_path / "cone.csv", slices=10)
    assert again.slices == 10
    assert again.volume == pytest.approx(clay.volume, rel=1e-3)  # the smooth solid's, O(h^2)


GOOD = "height,radius\n0,1\n1,2\n"
VARIANTS = {
    "as spreadsheets write it": "\ufeffHeight,Radius\r\n0,1\r\n1,2\r\n",
    "comments and blank lines": "# a cone\n\nheight,radius\n# foot\n0,1\n\n1,2\n\n",
    "spaces and quotes": ' "height" , radius\n 0 , 1\n"1", 2 \n',
    "columns turned around": "radius,height\n1,0\n2,1\n",
    "a column more": "name,height,radius\n7,0,1\n8,1,2\n",
    "no line end": "height,radius\n0,1\n1,2",
}


@pytest.mark.parametrize("text", VARIANTS.values(), ids=VARIANTS)
def test_harmless_variants_are_read(tmp_path, text):
    clay = load_profile(write(tmp_path, text, encoding="utf-8", newline=""), slices=8)
    same_bits(clay, Clay.from_profile([0, 1], [1, 2], slices=8))


BAD = {
    "height,radius\n0,1\n1," + 200_000 * "1": "line 3 is no CSV",
    "height,radius\n0,1\n1,x\n2,1\n": r"line 3: radius 'x' is not a finite number",
    "height,radius\n0,1\nnan,1\n2,1\n": r"line 3: height 'nan' is not a finite number",
    "height,radius\n0,1\n1,inf\n2,1\n": r"line 3: radius 'inf' is not a finite number",
    "height,radius\n0,1\n1,\n2,1\n": r"line 3: radius '' is not a finite number",
    "height,radius\n0,1\n1,-2\n2,1\n": r"line 3: radius is -2",
    "height,radius\n0,1\n1,1\n\n# c\n0.5,1\n": r"line 6: height 0.5 does not increase: .* has 1",
    "height,radius\n0,1\n1,1\n1,2\n": r"line 4: height 1 does not increase",
    "height,radius\n0,1\n1,1,9\n": r"line 3: '1,1,9' has 3 values",
    "height,radius\n0,1\n1\n": r"line 3: '1' has 1 values",
    "height,width\n0,1\n1,1\n": r"line 1: the header 'height,width' must name .* radius",
    "0,1\n1,1\n": r"line 1: the header '0,1' must name",
    "height;radius\n0;1\n1;1\n": r"line 1: the header 'height;radius' must name",
    "height\tradius\n0\t1\n1\t1\n": r"line 1: the header",
    "height,radius\n0,1\n": r"at least 2 lines",
    "": r"needs a header",
    "height,radius\n0,1\n1,0\n": r"contour.csv: radii\[1\] is 0.*clips a pointed tip",
    "# unit = 1\n# r0 = wide\nheight,radius,thickness,top\n0,1,0,0\n1,1,1,1\n": (
        r"line 2: r0 'wide' is not a finite number"
    ),
    # A damaged thickness may not vanish in silence: the volume would.
    "# unit = 1\n# r0 = 1\nheight,radius,thickness\n0,1,0\n.1,1,.2\n.3,1,.2\n.5,1,-.2\n.7,1,.4\n": (
        r"line 7: thickness"
    ),
    "# unit = 0\n# r0 = 1\nheight,radius,thickness,top\n0,1,0,0\n.1,1,.3,.3\n.4,1,.3,.6\n": (
        r"contour.csv.*unit"
    ),
}


@pytest.mark.parametrize(("text", "message"), BAD.items(), ids=BAD.values())
def test_bad_files_are_named(tmp_path, text, message):
    path = write(tmp_path, text)
    with pytest.raises(ValueError, match=message) as error:
        load_profile(path)
    assert "contour.csv" in str(error.value)


def test_file_that_is_no_text_is_named(tmp_path):
    path = tmp_path / "contour.csv"
    path.write_bytes(b"\x89PNG\r\n\xff\xfe\x00")
    with pytest.raises(ValueError, match=r"contour\.csv"):
        load_profile(path)


def test_failed_write_leaves_the_old_file_alone(tmp_path, monkeypatch):
    path = write(tmp_path, GOOD)
    rows = iter(range(3))

    def fails(value):
        if next(rows, None) is None:
            raise OSError("no space left")
        return float(value)

    # The builtin that formats the numbers gives up in the middle of the file.
    monkeypatch.setattr("jaxclay.files.profiles.float", fails, raising=False)
    with pytest.raises(OSError, match="no space left"):
        save_profile(Clay.cylinder(), path)
    assert path.read_text() == GOOD
    assert [file.name for file in tmp_path.iterdir()] == ["contour.csv"]


def test_write_into_a_missing_folder_says_so(tmp_path):
    with pytest.raises(OSError, match="nowhere"):
        save_profile(Clay.cylinder(), tmp_path / "nowhere" / "piece.csv")


def test_bottles_are_read(bottles):
    for path in bottles:
        clay = load_profile(path)
        assert clay.unit == 1.0
        rows = np.genfromtxt(path, delimiter=",", skip_header=1)
        a, b, steps = rows[:-1, 1], rows[1:, 1], np.diff(rows[:, 0])
        volume = np.pi / 3 * np.sum(steps * (a * a + a * b + b * b))
        assert clay.volume == pytest.approx(volume, rel=1e-12)


def test_contour_runs_from_axis_to_axis():
    line = polyline(Clay.cylinder(radius=0.5, slices=4))
    expected = [[0, 0], [0.5, 0], *[[0.5, y / 8] for y in (1, 3, 5, 7)], [0.5, 1], [0, 1]]
    np.testing.assert_allclose(line, expected, atol=1e-15)


def test_contour_error_of_cylinders_by_hand():
    a, b = Clay.cylinder(0.5, 1.0), Clay.cylinder(0.6, 1.0)
    assert contour_error(a, b) == pytest.approx(0.1, rel=1e-12)
    taller = Clay.cylinder(0.6, 2.0)  # upper corners 0.1 and 1.0 apart
    assert contour_error(a, taller) == pytest.approx(np.hypot(0.1, 1.0) / 2, rel=1e-12)
    assert contour_error(a, a) == pytest.approx(0.0, abs=1e-14)


@settings(max_examples=10, deadline=None)
@given(seed=st.integers(0, 10**6), slices=st.sampled_from([5, 24]))
def test_contour_error_against_dense_points(seed, slices):
    rng = np.random.default_rng(seed)
    a, b = (piece(rng.uniform(0.5, 2, slices)) for _ in range(2))
    dense = oracles.hausdorff(polyline(a), polyline(b))
    length = np.hypot(*np.diff(polyline(a), axis=0).T).max()
    assert contour_error(a, b) == pytest.approx(contour_error(b, a), rel=1e-12)
    # The farthest point is sought at four points a segment.
    assert dense - length / 8 <= contour_error(a, b) <= dense + 1e-3


def test_area_error_of_cylinders_by_hand():
    a, b = Clay.cylinder(0.5, 1.0), Clay.cylinder(0.6, 1.0)
    assert area_error(a, b) == pytest.approx(0.1 / 0.6, rel=1e-12)
    tall = Clay.cylinder(0.5, 1.5)
    assert area_error(tall, a) == pytest.approx(0.5, rel=2e-2)  # ends fall over half a slice
    assert area_error(a, a) == 0.0


def test_a_saved_file_on_another_grid_keeps_unit_and_volume(tmp_path):
    before = jaxclay.deform(
        jaxclay.Clay.cylinder(slices=64),
        jaxclay.Squash(0.1, 0.5, 0.4),
        jaxclay.Material.from_snake_units(mu=0.1),  # soft enough to raise the top
        scheme="paper",
    ).clay
    jaxclay.save_profile(before, tmp_path / "a.csv")
    after = jaxclay.load_profile(tmp_path / "a.csv", slices=128)
    assert after.slices == 128
    assert after.unit == before.unit != after.height
    assert after.r0 == before.r0
    np.testing.assert_array_equal(after.heights[::2], before.heights)
    volume = np.sum(np.pi * after.radii**2 * after.thickness)
    assert volume == pytest.approx(float(before.volume), rel=1e-14)


def test_a_saved_file_with_edited_radii_is_refused(tmp_path):
    path = tmp_path / "a.csv"
    jaxclay.save_profile(jaxclay.Clay.cylinder(slices=8), path)
    path.write_text(path.read_text().replace(",0.5,", ",0.6,"))
    with pytest.raises(ValueError, match=r"radius 0\.6 of slice 0.*0\.5.*by hand"):
        jaxclay.load_profile(path)


def test_comments_of_other_programs_are_only_comments(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("# unit = cm\nname,height,radius\nfoot,0,1\nlip,2,1\n")
    assert jaxclay.load_profile(path, slices=8).unit == 2.0
