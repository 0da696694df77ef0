import numpy as np
import oracles
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scenes import SNAKE, piece

import jaxclay
from jaxclay import Clay, Squash, area_error, contour_error, load_profile, save_profile
from jaxclay.clay.contour import polyline
from jaxclay.files.piece import Piece, save_piece
from jaxclay.files.profiles import loaded, read_profile
from jaxclay.files.several import RefusedProfile, only_profiles, refusing


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
    assert error <= 1e-5
    assert fine.slices < 500  # halved where the contour turns, and nowhere else


def test_a_profile_is_cut_until_it_is_near_and_the_error_is_its_distance(tmp_path):
    path = write(tmp_path, "height,radius\n2,3\n3,4\n3.5,2\n5,2.5\n")
    clay, error = loaded(path)
    assert clay.slices < 200  # corners are cut: of first order
    profile = np.array([[0, 0], [3, 0], [4, 1], [2, 1.5], [2.5, 3], [0, 3]])
    assert error <= 1e-5
    coarse = read_profile(path).cut(near=1e-2)
    assert 1e-5 < coarse.error <= 1e-2
    found = oracles.hausdorff(polyline(coarse.clay), profile, 4_000) / 3
    assert coarse.error == pytest.approx(found, rel=0.2)
    assert loaded(path, 64).error > 10 * error
    straight = loaded(write(tmp_path, "height,radius\n0,1\n1,1\n"))
    assert straight.clay.slices == 64
    assert straight.error < 1e-12


def test_as_near_as_asked(tmp_path):
    """A vessel with a stem: slices of equal volume lose percents of its height."""
    y = np.linspace(0, 160, 54)
    radius = np.where(y < 15, 40 - 2.3 * y, np.where(y < 80, 5.5, 5.5 + 0.6 * (y - 80)))
    rows = "".join(f"{a:.6f},{b:.6f}\n" for a, b in zip(y, radius, strict=True))
    profile = read_profile(write(tmp_path, "height,radius\n" + rows))
    assert profile.cut(64).error > 1e-2
    for near in (1e-3, 1e-5, 1e-7):
        clay, error = profile.cut(near=near)
        assert error <= near
        frusta = (
            np.pi / 3 * np.diff(y) * (radius[1:] ** 2 + radius[1:] * radius[:-1] + radius[:-1] ** 2)
        )
        assert clay.volume == pytest.approx(frusta.sum(), rel=1e-6)


def test_a_profile_of_5000_rows_is_read_whole(tmp_path):
    """A groove of ten rows would be lost between slices of equal volume."""
    y = np.arange(5000) / 10
    radius = 40 + 8 * np.sin(y / 60) - 3.0 * ((y > 250) & (y < 251))
    rows = "".join(f"{a},{b!r}\n" for a, b in zip(y, radius.tolist(), strict=True))
    clay, error = loaded(write(tmp_path, "height,radius\n" + rows))
    assert error <= 1e-5
    assert clay.radius_at(250.5) == pytest.approx(37 + 8 * np.sin(250.5 / 60), rel=1e-3)


def test_steps_are_exact(tmp_path):
    clay, error = loaded(write(tmp_path, "height,radius\n0,20\n10,20\n10,14\n30,14\n"))
    assert error < 1e-14
    assert list(clay.radius_at(np.array([9.999, 10.001]))) == pytest.approx([20, 14], rel=1e-9)
    volume = np.pi * (20**2 * 10 + 14**2 * 20)
    assert clay.volume == pytest.approx(volume, rel=1e-14)


@pytest.mark.parametrize("base", [0.0, 60.0, -12.5])
@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_a_saved_table_has_the_same_contour(tmp_path, base, tolerance):
    """Of a squashed piece, with jumps of the radius where nothing smooths."""
    path = tmp_path / "a.csv"
    before = read_profile("amphora").cut(near=tolerance / 10).clay
    material = jaxclay.Material(alpha=0.0, beta=0.0)
    clay = jaxclay.deform(before, Squash(0.4, 0.6, 0.2), material, slices=128).clay
    save_profile(clay, path, base, "cm")
    profile = read_profile(path)
    assert (profile.base, profile.length_unit) == (base, "cm")
    assert contour_error(profile.cut().clay, clay) < 1.2e-5


def test_a_saved_table_is_one_for_every_program(tmp_path):
    pandas = pytest.importorskip("pandas")
    clay = Clay.from_profile([0, 1], [1, 2], slices=4)
    save_profile(clay, tmp_path / "cone.csv")
    text = (tmp_path / "cone.csv").read_text()
    assert text.startswith("height,radius\n0,")
    table = pandas.read_csv(tmp_path / "cone.csv")
    assert list(table) == ["height", "radius"]
    assert list(table.dtypes) == [float, float]
    middles = (clay.heights[1:] + clay.heights[:-1]) / 2
    np.testing.assert_allclose(table.height[1:-1], middles, rtol=1e-11)
    np.testing.assert_allclose(table.radius[1:-1], clay.radii, rtol=1e-11)
    np.testing.assert_allclose(table.height.iloc[[0, -1]], [0, clay.height], rtol=1e-11)
    save_profile(clay, tmp_path / "cone.csv", base=60, length_unit="mm")
    table = pandas.read_csv(tmp_path / "cone.csv")
    assert list(table) == ["height_mm", "radius_mm"]
    assert table.height_mm[0] == 60


@pytest.mark.parametrize("slices", [0, 2, -5])
def test_too_few_slices_are_named(slices):
    with pytest.raises(ValueError, match=f"slices must be .* at least 3, got {slices}"):
        load_profile("bowl", slices=slices)


def test_unknown_name_lists_the_known_ones(tmp_path):
    with pytest.raises(ValueError, match="no profile 'kettle': choose from teapot, amphora, bowl"):
        load_profile("kettle")
    with pytest.raises(OSError, match=r"missing\.csv"):
        load_profile(tmp_path / "missing.csv")


@pytest.mark.core
def test_a_piece_is_a_profile_too(tmp_path):
    clay = jaxclay.deform(Clay.cylinder(), Squash(0.35, 0.6, 0.4), SNAKE, scheme="paper").clay
    path = tmp_path / "a.json"
    save_piece(path, Piece(clay, base=3.0, length_unit="mm"))
    profile = read_profile(path)
    assert (profile.base, profile.length_unit) == (3.0, "mm")
    assert "a piece: 64 slices, 0 strokes, in mm" in profile.said
    found = load_profile(path)
    np.testing.assert_array_equal(found.thickness, clay.thickness)
    assert (found.unit, found.r0) == (clay.unit, clay.r0)
    fine = load_profile(path, slices=128)
    assert fine.slices == 128
    np.testing.assert_allclose(fine.heights[::2], clay.heights, rtol=1e-14)
    coarse = loaded(path, 32)
    assert coarse.error == contour_error(coarse.clay, clay) > 0
    for option in ("columns", "unit", "minimum_radius"):
        with pytest.raises(ValueError, match=rf"a\.json is a piece, no table: {option}"):
            read_profile(path, **{option: "mm"})


def test_packaged_profiles_are_no_tables():
    with pytest.raises(ValueError, match="bowl is no table: unit 'mm' has no meaning"):
        load_profile("bowl", unit="mm")


GOOD = "height,radius\n0,1\n1,2\n"


def test_several_files_are_those_that_are_profiles(tmp_path):
    good, bad, worse = (str(tmp_path / name) for name in ("good.csv", "bad.csv", "worse.csv"))
    write(tmp_path, GOOD, "good.csv")
    write(tmp_path, "height,radius\n0,1\n1,nan\n", "bad.csv")
    message = r"left out .*bad\.csv: line 3: radius 'nan'"
    with pytest.warns(RefusedProfile, match=message):
        assert only_profiles([good, bad]) == [good]
    with pytest.warns(RefusedProfile, match=r"left out .*worse\.csv"):  # there is no such file
        assert only_profiles([good, worse]) == [good]
    for files in ([bad], [bad, worse]):
        with pytest.raises(ValueError, match=r"bad\.csv: line 3"):
            only_profiles(files)


def test_the_first_that_is_none_ends_it_where_asked(tmp_path, capsys):
    files = [str(write(tmp_path, text, f"{i}.csv")) for i, text in enumerate((GOOD, "no"))]
    with pytest.raises(ValueError, match=r"^\S*1\.csv: no numbers"), refusing(strict=True):
        only_profiles(files)
    with refusing(strict=False):
        assert only_profiles(files) == files[:1]
    assert "1.csv: no numbers" in capsys.readouterr().err


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


def test_comments_of_other_programs_are_only_comments(tmp_path):
    path = tmp_path / "a.csv"
    path.write_text("# unit = cm\nname,height,radius\nfoot,0,1\nlip,2,1\n")
    assert jaxclay.load_profile(path, slices=8).unit == 2.0
