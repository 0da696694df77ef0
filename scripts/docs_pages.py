"""Write the API reference; see scripts/docs."""

from __future__ import annotations

import importlib
import pkgutil
import sys
import typing
import warnings
from pathlib import Path
from typing import Any

import pdoc
import pdoc.render

import jaxclay


def main() -> int:
    """Write a page for each module into the folder named on the command line."""
    warnings.simplefilter("error")
    warnings.filterwarnings("ignore", "JAXopt is no longer maintained", DeprecationWarning)
    for module in modules():
        resolve_fields(module)
    pdoc.render.configure(docformat="numpy", footer_text=f"jaxclay {jaxclay.__version__}")
    folder = Path(sys.argv[1])
    pdoc.pdoc("jaxclay", output_directory=folder)
    print(f"wrote {len(list(folder.rglob('*.html')))} pages, from {folder / 'index.html'}")
    return 0


def modules():
    """Every module of the package, imported."""
    yield jaxclay
    for found in pkgutil.walk_packages(jaxclay.__path__, "jaxclay."):
        yield importlib.import_module(found.name)


def resolve_fields(module) -> None:
    """Tell pdoc the types of named tuples, whose constructors have lost their module's names."""
    value: Any
    for value in vars(module).values():
        fields = getattr(value, "_fields", None)
        if isinstance(value, type) and issubclass(value, tuple) and fields:
            try:
                hints = typing.get_type_hints(value)
            except NameError:  # of a package that only type checkers import
                hints = {}
            value.__new__.__annotations__ = {k: hints[k] for k in fields if k in hints}


if __name__ == "__main__":
    sys.exit(main())
