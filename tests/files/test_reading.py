"""Tables as people have them: each opens as its plain form does, or is refused with the cure."""

import codecs

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxclay import Clay, load_profile
from jaxclay.clay.outline import Outline
from jaxclay.files.profiles import read_profile

PLAIN = [(0, 4), (2, 5.5), (4, 4.5)]
POT = "0,4\n2,5.5\n4,4.5\n"


def read(folder, content, name="pot.csv", **options):
    """The profile of a text, or of bytes; its heights and radii, and what was said."""
    path = folder / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    profile = read_profile(path, **options)
    assert isinstance(profile.drawn, Outline)
    rows = list(zip(profile.drawn.heights, profile.drawn.radii, strict=True))
    return profile, np.array(rows), profile.said


def utf16(text):
    return text.encode("utf-16-le")


# content, words that are said, and the contour where it is not PLAIN
OPENED = {
    "plain": ("height,radius\n" + POT, "read 3 rows: commas, height and radius"),
    "semicolons": ("height;radius\n0;4\n2;5.5\n4;4.5\n", "semicolons, height"),
    "semicolons, decimal commas": (
        "height;radius\n0,0;4,0\n2,0;5,5\n4,0;4,5\n", "semicolons, decimal commas, height",
    ),
    "tabs": ("height\tradius\n0\t4\n2\t5.5\n4\t4.5\n", "tabs"),
    "tabs, decimal commas": ("height\tradius\n0\t4\n2\t5,5\n4\t4,5\n", "tabs, decimal commas"),
    "blanks": ("height radius\n0 4\n2 5.5\n4 4.5\n", "blanks"),
    "fixed width": ("  height    radius\n    0.0      4.0\n    2.0  5.5\n 4 4.5\n", "blanks"),
    "blanks, decimal commas": ("height radius\n0,0 4,0\n2,0 5,5\n4,0 4,5\n", "blanks, decimal co"),
    "bars": ("height|radius\n0|4\n2|5.5\n4|4.5\n", "bars"),
    "quoted cells": ('"height","radius"\n"0,0","4,0"\n"2,0","5,5"\n"4,0","4,5"\n', "decimal com"),
    "three decimals": ("height;radius\n0,000;4,000\n2,000;5,500\n4,000;4,500\n", "decimal commas"),
    "exponents": ("height,radius\n0,4E0\n2.0e+00,.55e1\n4,45e-1\n", "commas"),
    "a minus of print": ("height,radius\n\N{MINUS SIGN}0,4\n2,5.5\n4,4.5\n", "commas"),
    "UTF-8 with its mark": (codecs.BOM_UTF8 + b"height,radius\n" + POT.encode(), "rows: commas"),
    "UTF-16": (("height,radius\n" + POT).encode("utf-16"), "UTF-16, commas"),
    "UTF-16 without a mark": (utf16("height,radius\r\n" + POT), "UTF-16, commas"),
    "Latin-1": (("# Gefäß\nheight,radius\n" + POT).encode("latin-1"), "Latin-1, commas"),
    "line ends of Windows": (("height,radius\n" + POT).replace("\n", "\r\n"), "read 3 rows"),
    "line ends of old Macs": (("height,radius\n" + POT).replace("\n", "\r"), "read 3 rows"),
    "the end of a file in DOS": ("height,radius\n" + POT + "\x1a", "read 3 rows"),
    "hard blanks": ("height,radius\n0,4\xa0\n2,\xa05.5\n4,4.5\n", "read 3 rows"),
    "comments": ("# pot\n% 12\n\nheight,radius\n# foot\n" + POT, "read 3 rows"),
    "text after a #": ("height,radius\n0,4  # foot\n2,5.5# belly\n4,4.5\n", "read 3 rows"),
    "a title": ("Pot 12, trench 3\n\nheight,radius\n" + POT, "read 3 rows"),
    "Excel's separator": ("sep=;\nheight;radius\n0;4\n2;5.5\n4;4.5\n", "semicolons"),
    "a header in a comment": ("# height radius\n0 4\n2 5.5\n4 4.5\n", "height and radius"),
    "no header": (POT, "no header, column 1 as height and 2 as radius"),
    "no header, turned around": (
        "4,0\n5.5,2\n4.5,4\n", "column 1 as height and 2 as radius, the other way round",
    ),
    "row numbers of R": (
        '"height" "radius"\n"1" 0 4\n"2" 2 5.5\n"3" 4 4.5\n', "row numbers left out",
    ),
    "row numbers of R in CSV": ('"","height","radius"\n"1",0,4\n"2",2,5.5\n"3",4,4.5\n', "commas"),
    "ImageJ": (" ,X,Y\n1,4,0\n2,5.5,2\n3,4.5,4\n", "Y as height and X as radius"),
    "row numbers, no header": ("1,0,4\n2,2,5.5\n3,4,4.5\n", "column 2 as height and 3 as radius"),
    "a column called #": ("#,height,radius\n1,0,4\n2,2,5.5\n3,4,4.5\n", "read 3 rows"),
    "trailing cells and lines": ("height,radius,,\n0,4,,\n2,5.5,,\n4,4.5,,\n\n,,\n", "read 3 rows"),
    "notes": ('id,height,radius,note\n1,0,4,"a, b"\n2,2,5.5,\n3,4,4.5,"c # d"\n', "read 3 rows"),
    "any case, turned around": ("RADIUS,Height\n4,0\n5.5,2\n4.5,4\n", "height and radius"),
    "x, y, z and a radius": ("x,y,z,radius\n9,9,0,4\n9,9,2,5.5\n9,9,4,4.5\n", "z as height and ra"),
    "a long comment": ("# " + 200_000 * "x" + "\n" + POT, "no header"),
    "z and r": ("r;z\n4;0\n5.5;2\n4.5;4\n", "z as height and r as radius"),
    "h and x": ("h,x\n" + POT, "h as height and x as radius"),
    "diameter": ("y,Diameter\n0,8\n2,11\n4,9\n", "y as height and diameter"),
    "d": ("h,d\n0,8\n2,11\n4,9\n", "h as height and d as diameter"),
    "circumference": (
        "height,circumference\n0,25.132741228718345\n2,34.55751918948772\n4,28.274333882308138\n",
        "height and circumference",
    ),
    "in German": (
        "Höhe (cm);Durchmesser (cm)\n0;8\n2;11\n4;9\n".encode("latin-1"),
        "Latin-1, semicolons, Höhe as height and Durchmesser as diameter in cm",
    ),
    "a radius beside a diameter": ("height,diameter,radius\n0,8,4\n2,11,5.5\n4,9,4.5\n", "radius"),
    "falling": (
        "height,radius\n4,4.5\n2,5.5\n0,4\n", "read 3 rows: commas, height and radius, turned upsid"
    ),
    "the left half": ("height,radius\n0,-4\n2,-5.5\n4,-4.5\n", "mirrored from the left half"),
    "both halves": (
        "height,radius\n4,-4.5\n2,-5.5\n0,-4\n0,4\n2,5.5\n4,4.5\n",
        "both halves averaged, whose radii differ by up to 0",
    ),
    "both halves, closed, apart": (
        "x,y\n0,4\n-4.25,4\n-5.5,2\n-4,0\n0,0\n4,0\n5.5,2\n4.75,4\n0,4\n",
        "both halves averaged, whose radii differ by up to 0.5",
    ),
    "both halves row by row": ("y,x\n0,-4\n0,4\n2,-5\n2,6\n4,-4.5\n4,4.5\n", "by up to 1"),
    "a closed foot": ("height,radius\n0,0\n0,2\n" + POT, "closed foot left out"),
    "a closed lid": ("height,radius\n" + POT + "4,0\n", "closed lid left out"),
    "a repeated row": ("height,radius\n0,4\n2,5.5\n2,5.5\n4,4.5\n", "1 repeated left out"),
    "a base": (
        "height,radius\n60,4\n62,5.5\n64,4.5\n", "standing at 60", [(60, 4), (62, 5.5), (64, 4.5)],
    ),
    "heights below 0": (
        "height,radius\n-2,4\n0,5.5\n2,4.5\n", "standing at -2", [(-2, 4), (0, 5.5), (2, 4.5)],
    ),
    "a tip": (
        "height,radius\n0,4\n2,5\n4,0\n", "radius 0 at the top clipped to the floor 0.15",
        [(0, 4), (2, 5), (4, 0.15)],
    ),
    "two tips": (
        "height,radius\n0,0\n2,5\n4,0\n", "radius 0 at the foot and top clipped to the floor 0.15",
        [(0, 0.15), (2, 5), (4, 0.15)],
    ),
    "a step": (
        "height,radius\n0,4\n2,5.5\n2,3\n4,4.5\n", "1 step", [(0, 4), (2, 5.5), (2, 3), (4, 4.5)],
    ),
    "a ledge drawn in points": (
        "height,radius\n0,4\n2,5.5\n2,4\n2,3\n4,4.5\n", "1 step",
        [(0, 4), (2, 5.5), (2, 3), (4, 4.5)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", OPENED)
def test_it_opens_as_its_plain_form(tmp_path, name):
    content, words, *other = OPENED[name]
    _, rows, said = read(tmp_path, content)
    np.testing.assert_allclose(rows, other[0] if other else PLAIN, rtol=1e-14)
    assert words in said


UNITS = {
    "Height (mm),Radius (mm)": "mm", "height_cm,radius_cm": "cm", "HEIGHT [m],RADIUS [m]": "m",
    "height in inches,radius in inches": "in", "h/mm,r/mm": "mm", "height (mm),radius": "mm",
    'height ("),radius (")': "in", "height (pixels),radius (pixels)": "px", "height,radius": None,
    "height,radius\nmm,mm": "mm", '"height\n(mm)","radius\n(mm)"': "mm", "height,r": None,
}  # fmt: skip


@pytest.mark.parametrize("header", UNITS)
def test_the_unit_is_kept_and_told(tmp_path, header):
    unit = UNITS[header]
    profile, rows, said = read(tmp_path, f"{header}\n{POT}")
    assert profile.length_unit == unit
    assert (f" in {unit}" in said) if unit else (" in " not in said)
    np.testing.assert_array_equal(rows, PLAIN)


def test_columns_and_unit_are_as_asked(tmp_path):
    text = "a,b,inner,outer,d\n0,4,1,2,8\n2,5.5,1,2,11\n4,4.5,1,2,9\n"
    with pytest.raises(ValueError, match="nothing looks like height in the columns a, b, inner"):
        read(tmp_path, text)
    for columns in ("a,b", "A, B", "1,2", "a,d", "1,5"):
        np.testing.assert_array_equal(read(tmp_path, text, columns=columns)[1], PLAIN)
    profile, _, said = read(tmp_path, text, columns="a,outer", unit="millimetres")
    assert profile.length_unit == "mm"
    assert "a as height and outer as radius in mm" in said
    np.testing.assert_array_equal(read(tmp_path, POT, columns="1,2")[1], PLAIN)
    # Of two units that a header names the one that is asked for is taken for both.
    differ = "height (cm),radius (mm)\n" + POT
    assert read(tmp_path, differ, unit="cm")[0].length_unit == "cm"


REFUSED_OPTIONS = {
    "height": "is not HEIGHT,RADIUS", "height,height": "is not HEIGHT,RADIUS",
    "height,width": "line 1: no columns 'height,width': the header names height, radius",
    "1,7": r"line 1: no columns|has 2 columns",
}  # fmt: skip


@pytest.mark.parametrize("columns", REFUSED_OPTIONS)
def test_columns_that_are_not_there_are_refused(tmp_path, columns):
    with pytest.raises(ValueError, match=REFUSED_OPTIONS[columns]):
        read(tmp_path, "height,radius\n" + POT, columns=columns)


def test_names_without_a_header_are_refused(tmp_path):
    with pytest.raises(ValueError, match=r"no header with these names; its 2 columns .* 1 to 2"):
        read(tmp_path, POT, columns="height,radius")


def test_a_unit_that_is_none_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"--unit 'furlong' is no unit .*mm, cm"):
        read(tmp_path, POT, unit="furlong")
    with pytest.raises(ValueError, match=r"--unit 'furlong' is no unit .*mm, cm"):
        read(tmp_path, "height,radius\n" + POT, unit="furlong")


HEAD = "height,radius\n"
HOLLOW = "0,15\n50,20\n80,25\n80,23\n50,18\n3,13\n3,0\n0,0\n"
REFUSED = {
    "empty": ("", "the file is empty"),
    "a header alone": (HEAD, "no numbers"),
    "no numbers": ("pot,bowl\nred,blue\n", "no numbers"),
    "a single row": (HEAD + "0,4\n", "line 2: a single row"),
    "one height": (HEAD + "1,4\n1,5\n", "line 2: 2 rows of one height"),
    "an overhang": (
        HEAD + "0,10\n10,20\n8,25\n20,22\n", "line 4: height 8 follows 10: the wall overhangs.*out",
    ),
    "a kicked base": (HEAD + "2,0\n0,10\n10,20\n", "line 4: height 10 follows 0: the wall over"),
    "a hollow vessel": (
        HEAD + HOLLOW, "line 6: height 50 follows 80: outer and inner line of a hollow.*keep the "
        "outer line, lines 2 to 4, and take out lines 5 to 9",
    ),
    "its inner line first": (
        HEAD + "\n".join(reversed(HOLLOW.split())), "outer line, lines 6 to 9.*lines 2 to 5",
    ),
    "both halves beside the axis": (
        HEAD + "4,95\n2,90\n0,98\n0,112\n2,120\n4,115\n", "line 6: height 2 follows 0: .*"
        "Of both halves of a drawing subtract where the axis is$",
    ),
    "an overhang of one half": (
        HEAD + "0,-4\n2,-5\n1,-6\n4,-5\n0,4\n4,5\n", "left half: line 4: height 1 follows 2",
    ),
    "an empty cell": (HEAD + "0,4\n1,\n2,5\n", "line 3: radius is empty: fill"),
    "NaN": (HEAD + "0,4\n1,NaN\n2,5\n", "line 3: radius 'NaN' is not a finite number: take"),
    "infinite": (HEAD + "0,4\n-inf,4\n2,5\n", "line 3: height '-inf' is not a finite number"),
    "beyond float64": (HEAD + "0,4\n1,1e999\n2,5\n", "line 3: radius '1e999' is not a finite"),
    "too large": (HEAD + "0,4\n1e300,5\n", r"line 3: height is 1e\+300, but at most"),
    "a word": (HEAD + "0,4\n1,wide\n2,5\n", "line 3: radius 'wide' is not a finite number"),
    "a word in the first row": (HEAD + "0,wide\n1,4\n2,5\n", "line 2: radius 'wide'"),
    "units in cells": (HEAD + "0 mm,4 mm\n2 mm,5 mm\n", r"line 2: height '0 mm'.*height \(mm\)"),
    "an underscore": (HEAD + "0,4\n1_0,5\n20,5\n", "line 3: height '1_0' is not a finite"),
    "a footer": (HEAD + "0,4\n1,5\nmean,4.5\n", "line 4: height 'mean' is not a finite"),
    "decimal commas between commas": (HEAD + "0,0,4,2\n1,5,5,1\n", "line 2: 4 values.*quotes"),
    "the same without a header": ("0,0,4,2\n1,5,5,1\n", "line 1: no header, and 4 columns"),
    "fewer cells": (HEAD + "0,4\n1\n2,5\n", "line 3: radius is empty"),
    "thousands": (HEAD + '0,"1,020"\n1000,"1,100"\n', "line 2: radius '1,020' may be 1020 with"),
    "thousands beside points": (
        'height;radius\n0;"1,020.5"\n1;2\n', "line 2: radius '1,020.5' has thousands separators",
    ),
    "thousands in German": (
        "height;radius\n0;1.020,5\n1;1.100,5\n", "line 2: radius '1.020,5' has thousands",
    ),
    "thousands in Swiss": ("height;radius\n0;1'020\n1;1'100\n", "line 2: radius .* has thousands"),
    "thousands by blanks": ("height;radius\n0;1\xa0020\n1;1\xa0100\n", "has thousands separators"),
    "millions": ("height;radius\n0;1.020.000\n1;2\n", "line 2: radius '1.020.000' has thousands"),
    "commas or thousands": (
        "height;radius\n60,000;40,125\n63,000;39,500\n", "line 2: height '60,000' may be 60000 .*"
        "or 60.000 with a decimal comma",
    ),
    "points and commas": (
        "height;radius\n0.5;4,2\n1.5;5,1\n", "line 2: radius '4,2' has a comma, but line 2 has '0.",
    ),
    "units that differ": (
        "height (cm),radius (mm)\n" + POT, "line 1: height is in cm, but radius in mm: bring both",
    ),
    "units that seem to differ": (HEAD + "0,0.05\n0.1,60\n", "line 3: the radius is 60, but heigh"),
    "no radius": ("height,width\n0,4\n1,5\n", "line 1: nothing looks like radius in .*height, wid"),
    "neither": ("pot;bowl\n0;4\n1;5\n", "nothing looks like height or radius in .* pot, bowl: say"),
    "a name twice": ("height,radius,Radius\n0,4,4\n1,5,5\n", "names radius twice"),
    "points in space": ("x,y,z\n4,0,0\n5,0,1\n", "x, y and z are points in space.*--columns z,x"),
    "a negative radius": (HEAD + "0,4\n1,-2\n2,5\n", "line 3: radius is -2, alone on the left"),
    "a neck of nothing": (HEAD + "0,4\n1,0\n2,4\n", "line 3: radius is 0 between the ends"),
    "NUL bytes": (HEAD + "0,4\n1,5\n\0\0\n", "line 4: a byte 0, which no text has"),
    "a picture": (b"\x89PNG\r\n\x1a\n\0\0", "line 2: a byte"),
    "a workbook": (b"PK\x03\x04\x14\0", "a workbook.* save its sheet as CSV"),
    "half of UTF-16": (b"\xff\xfeh\0e", "UTF-16, as it begins, but damaged"),
    "a long cell": (HEAD + "0,1\n1," + 200_000 * "1", "line 3 is no row of a table"),
}  # fmt: skip


@pytest.mark.parametrize("name", REFUSED)
def test_it_is_refused_with_the_line_and_the_cure(tmp_path, name):
    content, message = REFUSED[name]
    with pytest.raises(ValueError, match=message) as error:
        read(tmp_path, content)
    assert type(error.value) is ValueError
    assert str(error.value).startswith(f"{tmp_path / 'pot.csv'}: ")
    assert len(str(error.value).splitlines()) == 1


def test_a_file_that_is_larger_than_any_profile_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxclay.files.reading.MOST_BYTES", 10)
    with pytest.raises(ValueError, match="larger than any profile"):
        read(tmp_path, "height,radius\n" + POT)


def test_what_is_altered_is_told_in_python_too(tmp_path):
    path = tmp_path / "cone.csv"
    path.write_text("height,radius\n0,4\n2,0\n")
    with pytest.warns(UserWarning, match=r"cone\.csv: radius 0 at the top clipped to the floor"):
        load_profile(path)
    assert load_profile(path, minimum_radius=0.5).slices > 60  # asked for, and not told
    with pytest.warns(UserWarning, match="both halves averaged"):
        clay = Clay.from_profile([2, 0, 0, 2], [-1, -1, 1, 1], 8)
    np.testing.assert_array_equal(clay.heights, Clay.cylinder(1, 2, 8).heights)


SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "blanks"}
NAMES = {"radius": (1, ["radius", "r", "X", "Rad."]), "diameter": (2, ["Diameter", "d", "dia"]),
         "circumference": (2 * np.pi, ["circumference", "C", "Umfang"])}  # fmt: skip


@st.composite
def tables(draw):
    """A contour, and bytes that say it in a mixture of ways."""
    steps = draw(st.lists(st.integers(20, 900), min_size=1, max_size=6))
    y = draw(st.integers(-500, 9000)) / 100 + np.append(0, np.cumsum(steps)) / 100
    y = y.round(2)
    r = np.array(draw(st.lists(st.integers(50, 999), min_size=len(y), max_size=len(y)))) / 100
    rows = list(zip(y, r, strict=True))
    if draw(st.booleans()):
        rows = [(y[0], 0.0), *rows]
    if draw(st.booleans()):
        rows = [*rows, (y[-1], 0.0)]
    if draw(st.booleans()):
        rows = rows[::-1]
    sides = draw(st.sampled_from(["right", "left", "both"]))
    mirrored = [(a, -b) for a, b in rows]
    rows = {"right": rows, "left": mirrored, "both": mirrored[::-1] + rows}[sides]
    separator = draw(st.sampled_from(list(SEPARATORS)))
    comma = draw(st.booleans())
    quoted = separator == "," and comma
    scale, across = NAMES[draw(st.sampled_from(list(NAMES)))]
    unit = draw(st.sampled_from([None, "mm", "cm"]))
    styles = ["{}_{}", "{} ({})", "{} [{}]"]
    style = draw(st.sampled_from(styles[:1] if separator == " " else styles))
    names = [draw(st.sampled_from(["Height", "height", "z", "H"])), draw(st.sampled_from(across))]
    header = [style.format(name, unit) if unit else name for name in names]
    swapped = draw(st.booleans())
    lines = []
    for pair in rows:
        cells = [f"{pair[0]:.2f}", f"{scale * pair[1]:.9f}"]
        cells = [cell.replace(".", ",") if comma else cell for cell in cells]
        lines.append(cells[::-1] if swapped else cells)
    lines = [header[::-1] if swapped else header, *lines]
    if draw(st.booleans()):
        lines = [["no", *lines[0]], *([str(i), *row] for i, row in enumerate(lines[1:], 1))]
    if draw(st.booleans()) and separator != " ":
        lines = [[*row, ""] for row in lines]
    text = [separator.join(f'"{cell}"' if quoted else cell for cell in row) for row in lines]
    if draw(st.booleans()):
        text[1:1] = ["", "# a comment, with; a\tseparator"]
    if draw(st.booleans()):
        text[-1] += " # the last"
    if draw(st.booleans()):
        text = ["Gefäß Nr. 12", *text]
    if draw(st.booleans()) and separator == ";":
        text = ["sep=;", *text]
    text = draw(st.sampled_from(["\n", "\r\n", "\r"])).join([*text, ""])
    encoding = draw(st.sampled_from(["utf-8", "utf-8-sig", "utf-16", "latin-1"]))
    return np.stack([y, r], axis=1), text.encode(encoding), unit


@settings(max_examples=100, deadline=None)
@given(made=tables())
def test_mixtures_open_as_their_plain_form(tmp_path_factory, made):
    plain, content, unit = made
    profile, rows, _ = read(tmp_path_factory.getbasetemp(), content)
    np.testing.assert_allclose(rows, plain, rtol=1e-9)
    assert profile.length_unit == unit
