"""The rule of the house: rooms import to their left, nobody the face, no private name leaves."""

import ast
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

import jaxclay

PACKAGE = Path(jaxclay.__file__).parent
ROOT = Path(__file__).parents[2]
FACE = {"__init__.py", "__main__.py", "moved.py"}
FILES = sorted(path for path in PACKAGE.rglob("*.py"))


def imported(path):
    """(module, name) of all imports of a file, late and typing-only ones too."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from ((alias.name, "") for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{path}: a relative import"
            yield from ((node.module or "", alias.name) for alias in node.names)


def room(module):
    return module.split(".")[1] if module.count(".") else ""


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_nobody_inside_imports_the_face_or_what_is_private_elsewhere(path):
    mine = path.relative_to(PACKAGE).parts[0]
    rooms = {folder.name for folder in PACKAGE.iterdir() if folder.is_dir()}
    for module, name in imported(path):
        if module.split(".")[0] != "jaxclay":
            continue
        if module == "jaxclay":
            assert path.name in FACE or name in rooms, f"{path} imports the face for {name!r}"
        private = [part for part in [*module.split("."), name] if part.startswith("_")]
        if private and private != ["__version__"]:
            assert room(module) == mine, f"{path} takes {private} out of {module}"


TESTS = sorted((ROOT / "tests").rglob("*.py"))


@pytest.mark.parametrize("path", TESTS, ids=lambda path: str(path.relative_to(ROOT)))
def test_tests_take_nothing_private(path):
    tree = ast.parse(path.read_text(encoding="utf-8"))
    ours = {
        alias.asname or alias.name
        for node in ast.walk(tree)
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("jaxclay")
        for alias in node.names
    }
    assert not [name for name in ours if name.startswith("_")]
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
            private = node.attr.startswith("_") and not node.attr.startswith(("__", "_repr_"))
            assert not (private and node.value.id in ours), f"{node.value.id}.{node.attr}"
        if isinstance(node, ast.Call) and ast.unparse(node.func).endswith("setattr"):
            target, name = (ast.unparse(argument) for argument in node.args[:2])
            assert not (target in ours and name.startswith("'_")), f"{target}.{name}"
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            assert not re.search(r"\bjaxclay(\.\w+)*\._[a-z]\w", node.value, re.IGNORECASE)


def test_at_most_three_modules_lie_beside_the_face():
    assert len([path for path in PACKAGE.glob("*.py") if path.name != "__init__.py"]) <= 3


def test_every_folder_says_what_is_in_it_and_a_room_what_it_may_import():
    for folder in (path for path in PACKAGE.rglob("*") if (path / "__init__.py").exists()):
        text = ast.get_docstring(ast.parse((folder / "__init__.py").read_text(encoding="utf-8")))
        assert text, folder
        if folder.parent == PACKAGE:
            assert "mport" in text, folder


def contracts(root):
    command = [
        sys.executable,
        "-c",
        "from importlinter.cli import lint_imports_command as run; run()",
    ]
    return subprocess.run(
        [*command, "--no-cache"], cwd=root, env={"PYTHONPATH": str(root), "PATH": ""},
        capture_output=True, text=True, check=False, timeout=300,
    )  # fmt: skip


PLANTED = {
    "a late import back up": (
        "numerics/distance.py",
        "\n\ndef late():\n    from jaxclay.solve import minimize\n\n    return minimize\n",
    ),
    "a typing-only import back up": (
        "clay/slicing.py",
        "\nfrom typing import TYPE_CHECKING\n\nif TYPE_CHECKING:\n"
        "    from jaxclay.schemes.problem import Problem\n",
    ),
    "a circle in a room": ("model/squash.py", "\nfrom jaxclay.model import band\n"),
    "a library of another room": ("methods/adam.py", "\n\ndef late():\n    import pandas\n"),
}


@pytest.mark.parametrize(("file", "code"), [("", ""), *PLANTED.values()], ids=["", *PLANTED])
def test_the_contracts_hold_and_what_breaks_them_is_found(tmp_path, file, code):
    shutil.copytree(PACKAGE, tmp_path / "jaxclay", ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "pyproject.toml", tmp_path)
    if file:
        with (tmp_path / "jaxclay" / file).open("a", encoding="utf-8") as planted:
            planted.write(code)
    done = contracts(tmp_path)
    assert done.returncode == (1 if file else 0), done.stdout + done.stderr
