"""JupyterLab with a notebook that shows the studio, for the benchmark."""

from __future__ import annotations

import contextlib
import json
import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path

_CODE = "import jaxclay.studio\njaxclay.studio.Studio()"


@contextlib.contextmanager
def notebook(path: str) -> Iterator[str]:
    """The address of a notebook, ``path`` the front end's."""
    with tempfile.TemporaryDirectory() as folder:
        cell = {
            "cell_type": "code", "source": _CODE, "metadata": {}, "outputs": [], "id": "studio",
            "execution_count": None,
        }  # fmt: skip
        kernel = {"kernelspec": {"name": "python3", "display_name": "Python 3"}}
        text = {"nbformat": 4, "nbformat_minor": 5, "metadata": kernel, "cells": [cell]}
        (Path(folder) / "studio.ipynb").write_text(json.dumps(text), encoding="utf-8")
        command = [
            sys.executable, "-m", "jupyterlab", "--no-browser", "--ServerApp.port=0",
            "--allow-root", "--IdentityProvider.token=", f"--ServerApp.root_dir={folder}",
            "--LabApp.news_url=None",
        ]  # fmt: skip
        settings = os.environ | {"JUPYTER_CONFIG_DIR": f"{folder}/config"}
        process = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=settings)
        try:
            assert process.stderr is not None
            address = next(
                filter(None, (re.search(r"(http://\S+?:\d+)/lab", s) for s in process.stderr))
            )
            yield f"{address[1]}/{path}/studio.ipynb"
        finally:
            process.terminate()
            process.communicate(timeout=60)
