import numpy as np
import oracles
import pytest
from scipy.interpolate import BPoly

from jaxclay import SmoothClay
from jaxclay.bernstein import evaluate, hermite
from jaxclay.conversion import interpolated
from jaxclay.merging import merged, padded


def smooth_pieces(m):
    """A smooth Y with its own derivatives at m+1 breaks."""
    breaks, wave = np.arange(m + 1) / m, 2 * np.pi
    data = (
        1.25 * breaks + 0.1 * np.sin(wave * breaks),
        1.25 + 0.1 * wave * np.cos(wave * breaks),
        -0.1 * wave**2 * np.sin(wave * breaks),
    )
    control = hermite(np.diff(breaks), [v[:-1] for v in data], [v[1:] for v in data])
    return breaks, control


def moved(pieces, given, r0=0.5):
    """Largest distance between the contours of two Y, by dense points on both."""
    u = np.linspace(0, 1, 2001)
    lines = []
    for breaks, control in (pieces, given):
        Y, Y_u = BPoly(control.T, breaks)(u), BPoly(control.T, breaks).derivative()(u)
        lines.append(np.stack([r0 / np.sqrt(Y_u), Y], axis=1))
    return oracles.hausdorff(*lines, points=2000)


@pytest.mark.parametrize("tolerance", [1e-2, 1e-3, 1e-4])
def test_merged_pieces_stay_within_the_tolerance_of_what_was_given(tolerance):
    rng = np.random.default_rng(5)
    heights = np.concatenate([[0.0], np.cumsum(rng.uniform(0.8, 1.2, 12) * np.linspace(1, 2, 12))])
    for before in (smooth_pieces(40), interpolated(np.diff(heights) / 20, heights / 20)):
        breaks, control = merged(*before, 0.5, 2.0, tolerance / 2)  # over l = 2
        assert moved((breaks, control), before) <= tolerance * 1.01
        SmoothClay(breaks, control, 0.5, 2.0)
        assert set(breaks) <= set(before[0])
        twice = merged(breaks, control, 0.5, 2.0, tolerance / 2)
        assert len(twice[1]) >= len(control) / 2
        assert moved(twice, (breaks, control)) <= tolerance * 1.01


def test_fewer_pieces_the_looser_the_tolerance_and_one_for_one_quintic():
    given = smooth_pieces(64)
    counts = [len(merged(*given, 0.5, 1.0, t)[1]) for t in (1e-2, 1e-4, 1e-6, 1e-8, 1e-16)]
    assert counts == sorted(counts)
    assert counts[0] <= 4
    assert counts[-1] == 64
    # One polynomial of degree 5 cut into 16 is found again.
    c = np.array([0, 0.1, 0.3, 0.6, 0.7, 1.0])
    whole, breaks = BPoly(c[:, None], [0, 1]), np.linspace(0, 1, 17)
    data = [
        tuple(whole.derivative(k)(u) if k else whole(u) for k in range(3))
        for u in (breaks[:-1], breaks[1:])
    ]
    breaks, control = merged(breaks, hermite(np.diff(breaks), *data), 0.5, 1.0, 1e-12)
    assert list(breaks) == [0, 1]
    np.testing.assert_allclose(control, [c], atol=1e-14)


def test_a_jump_survives_merging_and_empty_pieces_do_not():
    breaks = np.array([0, 0.2, 0.4, 0.4, 0.7, 1.0, 1.0])
    slopes = np.array([1.0, 1.0, 0.0, 1.5, 1.5, 0.0])
    heights = np.concatenate([[0.0], np.cumsum(slopes * np.diff(breaks))])
    control = heights[:-1, None] + np.diff(heights)[:, None] * np.arange(6) / 5
    found, pieces = merged(breaks, control, 0.5, 1.0, 1e-3)
    assert list(found) == [0, 0.4, 1]
    np.testing.assert_allclose(pieces[:, 5], [0.4, 1.3], rtol=1e-14)
    smaller = merged(breaks, control, 0.5, 1.0, 0.2)[0]
    assert list(smaller) == [0, 1]  # a jump of 0.09 in the radius is less than 0.2


def test_padding_adds_empty_pieces_that_change_nothing():
    given = smooth_pieces(5)
    breaks, control = padded(*given, 8)
    assert control.shape == (8, 6)
    u = np.linspace(0, 1, 101)
    for a, b in zip(evaluate(breaks, control, u), evaluate(*given, u), strict=True):
        np.testing.assert_array_equal(a, b)
    SmoothClay(breaks, control - control[0, 0], 0.5, 1.0)
    with pytest.raises(ValueError, match="5 pieces do not fit into 4"):
        padded(*given, 4)
