"""What is wrong in an experiment file is refused, with its line and what is allowed."""

import pytest

pytest.importorskip("pydantic")

from test_experiment import SMALL, drawn

from jaxclay.experiments.entries.reading import read_experiment

KIND = 'kind = "throughput"'
SLICES = "slices = [8, 16]"
RADIUS = "radius = [0.4, 0.5]"
RATIO = "ratio = 0.8"
SQUASH = "squash = { bottom = 0.0, height = { from = 0.3, to = 0.5, count = 3 }, ratio = 0.8 }"
UNITS = '["snake", "printed"]'
PIECES = "cylinders = { radius = [0.4, 0.5] }\n" + SQUASH + "\nunits = " + UNITS
SETTINGS = "settings = { tolerance = [1e-4, 1e-14] }"
TOLERANCE = "tolerance = [1e-4, 1e-14]"
GREEDY = 'name = "greedy"'
HUGE = "100000000000000000000"  # beyond 64 bits

REFUSED = {
    (KIND, 'kind = "both"'): r"line 1: kind: .*'throughput' or 'timing'.*both",
    (KIND, KIND + "\nrepeats = 3"): "line 2: repeats: belongs to kind = \"timing\"",
    (KIND, KIND + '\nseed = "1"'): "line 2: seed: .*integer, got '1'",
    (KIND, KIND + "\nseed = true"): "line 2: seed: .*integer, got True",
    (KIND, KIND + "\nagree.energy = true"): "line 2: agree.energy: .*number, got True",
    (KIND, KIND + "\nagree = { energy = 1, contour = 2 }"): "line 2: agree.contour: .*got 2",
    (KIND, KIND + "\nelements = [8]"): "line 2: elements: without a method of scheme",
    (KIND, KIND + "\ntolerances = [1e-3]"): "line 2: tolerances: belong to newton with",
    (SLICES, "slices = []"): "line 2: slices: an empty list",
    (SLICES, "slices = [4]"): "line 2: slices: 4 is not .* between 8 and 4096",
    (SLICES, "slices = 8.5"): "line 2: slices: 8.5 is not a whole number between 8 and 4096",
    (SLICES, f"slices = {HUGE}"): r"line 2: slices: 1e\+20 is not .* between 8 and 4096",
    (SLICES, "slices = 1" + "0" * 5000): "one.toml: .*digits",
    (SLICES, "slices = [8, 16"): "one.toml: .*line 4",
    (SLICES, "colour = 1"): "line 2: colour: unknown key: choose from .*kind, seed",
    (RADIUS, "radius = -1"): "line 5: scenes.cylinders.radius: -1 .* above 0",
    (RADIUS, "radius = { uniform = [1, 2] }"): "line 5: scenes.cylinders.radius: .*must be drawn",
    (RADIUS + " }", RADIUS + " }\ndraws = 2.0"): "line 6: scenes.draws: .*integer, got 2.0",
    (RADIUS + " }", RADIUS + " }\nmaterial.mu = 1" + "0" * 400): "line 6: .*not a finite number",
    ("bottom = 0.0", "bottom = [0, 1]"): "line 6: .*squash.bottom: 1 lies above the piece",
    (RATIO, "ratio = 0.8, depth = 1"): "line 6: .*depth: unknown key: .*bottom, height",
    (RATIO, "ratio = 0.8, top_fixed = 1"): "line 6: .*top_fixed: .*boolean, got 1",
    (RATIO, "ratio = 0"): "line 6: scenes.squash.ratio: 0 is out of range",
    (RATIO, 'ratio = "big"'): "line 6: .*ratio: 'big' is not a finite number",
    (RATIO, f"ratio = {HUGE}"): r"line 6: .*ratio: 1e\+20 is out of range: .* at most 20",
    (RATIO, f"ratio = [0.8, {HUGE}]"): r"line 6: .*ratio: 1e\+20 is out of range",
    (RATIO, f"ratio = {{ uniform = [1, {HUGE}] }}"): r"line 6: .*ratio: 1e\+20 is out of range",
    (RATIO, f"ratio = {{ from = 1, to = {HUGE}, count = 2 }}"): r"line 6: .*1e\+20 is out of",
    ("count = 3", "count = 0"): "line 6: .*height: count must be a whole number of at least 1",
    ("count = 3", f"count = {HUGE}"): "line 6: .*height: count must be .* at most 10000, not 1000",
    (SQUASH, "[scenes.squash]\nbottom = 0\nheight = 0.3\nratio = 99"): "line 9: .*ratio: 99 is",
    (SQUASH, "squash.bottom = 0\nsquash.height = 1\nsquash.ratio = 99"): "line 8: .*ratio: 99 is",
    (SQUASH, "squash.bottom = 0\nsquash.height = 1"): "line 6: scenes.squash.ratio: is missing",
    (SQUASH, "squash = [\n{ bottom = 0, height = 1, ratio = 1 },\n\n{ ratio = 99 },\n]"): (
        "line 9: scenes.squash.ratio: 99 is"
    ),
    (RATIO, "'ratio' = '''\n[[scenes]]\nratio = 0'''"): "line 6: scenes.squash.ratio: .* is not",
    (UNITS, '["miles"]'): "line 7: .*'snake', 'printed' or 'move'.*miles",
    (PIECES, 'names = ["fig7"]\nunits = ["printed"]'): "line 6: scenes.units: .*fig7 .* in move",
    (PIECES, 'names = [\n"fig7",\n"fig99"]'): "line 7: scenes.names: .*'fig99': choose .*fig7",
    (PIECES, 'names = ["fig7"]\nmaterial = {}'): "line 6: scenes.material: .*beside names",
    ('"newton"', '"magic"'): "line 10: methods.name: unknown method 'magic'.*greedy",
    (TOLERANCE, "tolerance = 9"): "line 11: .*tolerance: .*between 1e-15 and 1, got 9",
    (TOLERANCE, "speed = 9"): "line 11: .*no setting 'speed': it takes",
    (TOLERANCE, "max_iterations = 1.5"): "line 11: .*max_iterations: 1.5 is not a whole number",
    (TOLERANCE, "tolerance = { uniform = [0.1, 0.2] }"): "line 11: .*tolerance: cannot be drawn",
    (SETTINGS, SETTINGS + '\nschemes = ["spline"]'): "line 12: methods.schemes: .*without elements",
    (SETTINGS, SETTINGS + "\nstops = [1]"): "line 12: methods.stops: .*beside several settings",
    (SETTINGS, 'schemes = ["spline"]'): "line 11: methods.schemes: .*give elements = ",
    (GREEDY, GREEDY + '\nschemes = ["spline"]'): "line 15: methods.schemes: .*takes newton",
    (GREEDY, GREEDY + "\nstops = [1]"): 'line 15: methods.stops: belongs to kind = "timing"',
    (GREEDY, GREEDY + "\n[methods.settings]\nthreshold = 1\nstep = 2"): "line 17: .*step: .*got 2",
    (GREEDY, 'name = "greedy-refined"\nsettings = { smallest_step = 2e-3, step = 1e-3 }'): (
        "line 15: methods.settings: smallest_step must be .* 0.001, got 0.002"
    ),
    (GREEDY, GREEDY + "\nsettings.step = { from = 1e-3, to = 1, count = 9999 }\n"
     "settings.threshold = [1, 2]"): "line 15: methods.settings: 19998 .*at most 10000",
}  # fmt: skip


@pytest.mark.parametrize("change", REFUSED, ids=lambda change: change[1][:60])
def test_what_cannot_be_run_is_refused_with_its_line(read, change):
    assert change[0] in SMALL
    with pytest.raises(ValueError, match=REFUSED[change]):
        read(SMALL.replace(*change))


def test_more_scenes_than_can_be_run_are_refused_without_making_them(read):
    many = SMALL.replace(RADIUS, "radius = { from = 1, to = 2, count = 10_000 }")
    enough = many.replace(RATIO, "ratio = { from = 1, to = 2, count = 16 }")
    assert read(enough).scenes[0].cylinders.radius.entries[-1] == 2
    with pytest.raises(ValueError, match="line 4: scenes: 1020000 combinations: at most 1000000"):
        read(enough.replace("count = 16", "count = 17"))


def test_another_encoding_than_utf_8_is_refused(tmp_path):
    path = tmp_path / "one.toml"
    for encoding in ("utf-16", "latin-1"):
        path.write_bytes(("# käse\n" + SMALL).encode(encoding))
        with pytest.raises(ValueError, match=r"one\.toml: .*must be UTF-8"):
            read_experiment(path)


@pytest.mark.parametrize("entry", ["", "/", ".", "**a", "none.csv", "x" * 5000, r"\u0000"])
def test_a_profile_that_names_no_file_is_refused(read, entry):
    text = drawn(1).replace('"bowl", "teapot"', f'"bowl",\n"{entry}"')
    with pytest.raises(ValueError, match=r"line 6: scenes\.profiles: no profile .*bowl.*CSV files"):
        read(text)


BAD_PROFILES = {
    "binary.csv": (b"\xff\xfe\x00", "UTF-16, as it begins, but damaged"),
    "empty.csv": (b"", "the file is empty"),
    "negative.csv": (b"height,radius\n0,1\n1,-1\n", "line 3: radius is -1, alone on the left"),
    "flat.csv": (b"height,radius\n0,0\n0,1\n", "2 rows of one height"),
    "long.csv": (b"x" * 200_000, "no numbers"),
    "one.txt": (b'kind = "timing"\n', "no numbers"),
}


@pytest.mark.parametrize("name", BAD_PROFILES)
def test_a_file_that_is_no_profile_is_refused(read, tmp_path, name):
    content, message = BAD_PROFILES[name]
    (tmp_path / "pots").mkdir()
    (tmp_path / "pots" / name).write_bytes(content)
    text = drawn(1).replace('"teapot"', '"pots/*"')
    with pytest.raises(ValueError, match=rf"line 6: scenes\.profiles: .*{name}: .*{message}"):
        read(text.replace('"bowl", ', '"bowl",\n'))


def test_a_folder_of_profiles_is_one_with_profiles(read, tmp_path):
    file = tmp_path / "pots" / "pot.csv"
    with pytest.raises(ValueError, match="pots does not exist: name a folder"):
        read(drawn(1), profiles=file.parent)
    file.parent.mkdir()
    with pytest.raises(ValueError, match=r"no CSV file in .*pots"):
        read(drawn(1), profiles=file.parent)
    file.write_text("height,radius\n0,1\n1,-1\n")
    with pytest.raises(ValueError, match=r"^\S*pot.csv: line 3: radius is -1, alone"):
        read(drawn(1), profiles=file.parent)
    with pytest.raises(ValueError, match=r"pot\.csv is a file: name a folder"):
        read(drawn(1), profiles=file)
