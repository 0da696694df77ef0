"""The statistics behind a sweep's charts, and what its panels write on their axes."""

import numpy as np
import pytest

pd = pytest.importorskip("pandas")
pytest.importorskip("matplotlib").use("Agg")

import matplotlib.pyplot as plt  # noqa: E402

from jaxclay.experiments.charts import panels, shared  # noqa: E402
from jaxclay.experiments.charts.panels import (  # noqa: E402
    exponent,
    ladder,
    performance_profile,
    times_to_solve,
)


def test_performance_profiles_count_what_nobody_solves():
    times = pd.DataFrame({"a": [1.0, 4.0, np.nan, np.nan], "b": [2.0, 1.0, 3.0, np.nan]})
    profile = performance_profile(times)
    for name, wanted in {"a": {1: 0.25, 3.9: 0.25, 4: 0.5}, "b": {1: 0.5, 2: 0.75}}.items():
        factors, shares = profile[name]
        for factor, share in wanted.items():
            assert shares[np.searchsorted(factors, factor, side="right") - 1] == share


def test_times_to_solve_are_of_the_quickest_setting_that_is_good_enough():
    rows = pd.DataFrame(
        [
            ("p", "newton", 1.0, 1e-2),
            ("p", "newton", 2.0, 1e-6),
            ("p", "newton", 3.0, -1e-7),
            ("q", "newton", 1.0, 1.0),
        ],
        columns=["problem", "family", "solve_s", "gap_relative"],
    )
    found = times_to_solve(rows, "gap_relative", 1e-5, "problem")
    assert found.loc["p", "newton"] == 2.0
    assert np.isnan(found.loc["q", "newton"])


def test_exponents():
    slices = np.array([16, 32, 64, 128])
    assert exponent(slices, 3e-5 * slices**1.7) == pytest.approx(1.7)
    assert np.isnan(exponent([64, 64], [1.0, 2.0]))


def test_a_ladders_band_holds_the_middle_of_the_scenes():
    errors = np.linspace(0, 1, 101)
    rows = pd.DataFrame({"settings": "loose", "solve_s": 0.5, "gap_relative": -errors})
    rungs = ladder(rows, "gap_relative", ["settings"])
    assert (rungs.low[0], rungs.middle[0], rungs.high[0]) == pytest.approx((0.1, 0.5, 0.9))


def test_numbers_on_axes_do_not_touch():
    figure, ax = plt.subplots(figsize=(4.6, 3.9), layout="constrained")
    ax.set(xscale="log", yscale="log", xlabel="x", ylabel="y")
    figure.draw_without_rendering()
    for low in (1.1e-16, 3e-6, 0.09, 0.24, 0.7, 5100.0):
        for factor in (1.05, 1.2, 2, 5, 9, 60, 300, 1e4, 1e9, 1e20):
            ax.set(xlim=(low, low * factor), ylim=(low, low * factor))
            shared.even_ticks(ax.xaxis, ax.yaxis)
            for axis, ends in ((ax.xaxis, "intervalx"), (ax.yaxis, "intervaly")):
                labels = axis.get_ticklabels()
                assert len({label.get_text() for label in labels}) == len(labels) > 1
                spans = np.array([getattr(label.get_window_extent(), ends) for label in labels])
                assert (spans[1:, 0] > spans[:-1, 1]).all()
    plt.close(figure)


def test_exponents_stand_at_the_ends_of_their_lines():
    grids = {"greedy": (8, 16), "lbfgs": (8, 16, 32), "newton": (8,)}
    rows = pd.DataFrame(
        [(name, n, n * 1e-4) for name, sizes in grids.items() for n in sizes],
        columns=["series", "slices", "solve_s"],
    )
    figure, ax = plt.subplots()
    panels.scaling(ax, rows)
    assert [(text.xy[0], text.get_text()) for text in ax.texts] == [
        (16, "$n^{1.00}$"),
        (32, "$n^{1.00}$"),
    ]
    plt.close(figure)
