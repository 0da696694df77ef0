"""The page of minimize_banded: its examples work."""

import re
from pathlib import Path

import jax
import numpy as np

from jaxclay.numerics import banded_newton

PAGE = Path(banded_newton.__file__).with_suffix(".md")


def test_its_examples_work():
    blocks = re.findall(r"```python\n(.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    assert len(blocks) == 3
    names = {}
    for block in blocks:
        exec(block, names)
    assert np.corrcoef(np.exp(names["fit"].x), names["counts"])[0, 1] > 0.7
    with jax.enable_x64(True):
        left_out = names["left_out"]
        difference = (left_out(1e3 + 1) - left_out(1e3 - 1)) / 2
    np.testing.assert_allclose(names["slope"], difference, rtol=1e-4)
    error = np.abs(np.asarray(names["many"].x[1]) - np.sin(7 * names["t"]))
    assert np.median(error) < 0.03
    assert names["path"].value < names["swing_up"](names["start"], 0.05, 0.1)
