"""Run notebooks and write one picture of each, the largest it draws, to notebooks/images."""

from __future__ import annotations

import argparse
import base64
import sys
from pathlib import Path

import nbclient
import nbformat

from jaxclay.files.output import patient_output

_FOLDER = Path(__file__).resolve().parent.parent / "notebooks"


def main() -> int:
    """Run what is asked for; 1 if a notebook draws nothing."""
    names = sorted(path.stem for path in _FOLDER.glob("*.ipynb"))
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help=f"of {', '.join(names)}; all if none is named")
    chosen = parser.parse_args().names or names
    if unknown := [name for name in chosen if name not in names]:
        parser.error(f"there is no notebook {unknown[0]!r}: choose from {', '.join(names)}")
    with patient_output():
        empty = [name for name in chosen if not written(name)]
    if empty:
        print(f"no picture in {', '.join(empty)}", file=sys.stderr)
    return 1 if empty else 0


def written(name: str) -> bool:
    """Whether the notebook drew a picture, which is then written."""
    notebook = nbformat.read(_FOLDER / f"{name}.ipynb", as_version=4)
    here = {"metadata": {"path": _FOLDER}}
    nbclient.NotebookClient(notebook, timeout=900, kernel_name="python3", resources=here).execute()
    pictures = [
        base64.b64decode(output["data"]["image/png"])
        for cell in notebook.cells
        for output in cell.get("outputs", [])
        if "image/png" in output.get("data", {})
    ]
    if not pictures:
        return False
    path = _FOLDER / "images" / f"{name}.png"
    path.write_bytes(max(pictures, key=len))
    print(f"wrote {path}")
    return True


if __name__ == "__main__":
    sys.exit(main())
