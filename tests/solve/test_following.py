"""A dragged tool: answers beside the last answer; and smoothing, which has no tool."""

import numpy as np

import jaxclay
from jaxclay.schemes.slices.posing import place
from jaxclay.solve.minimize import newton_answer
from jaxclay.solve.refining import beside, followed, to_tolerance
from jaxclay.solve.smoothing import smooth

CLAY = jaxclay.Clay.cylinder(0.4)
SOFT = jaxclay.Material.from_snake_units(mu=0.5, alpha=20.0, beta=50.0)


def test_an_answer_beside_another_is_as_near_to_the_exact_one():
    squash = [jaxclay.Squash(0.4, 0.6, 0.36 - 0.003 * i) for i in range(4)]
    exact = jaxclay.deform(CLAY, squash[-1], SOFT, tolerance=1e-5).clay
    answer = followed(to_tolerance(place(CLAY, squash[0], SOFT), 1e-3, (64, 128)), newton_answer)
    for one in squash[1:]:
        found = place(CLAY, one, SOFT)
        answer = followed(beside(found, 128, answer), newton_answer).raise_for_status()
    assert jaxclay.contour_error(answer.clay, exact) < 1e-3


def test_smoothing_is_the_minimum_of_its_energy():
    """By a search in random directions around it: no shape near has less."""
    worked = jaxclay.deform(CLAY, jaxclay.Squash(0.4, 0.6, 0.34), SOFT, slices=64).clay
    found = smooth(worked, SOFT, 0.3, 0.7, 10.0, 64)
    assert found.certified
    assert found.clay.r0 == worked.r0
    heights, rest = found.clay.heights, worked.heights

    def energy(y):
        """Eq. 9 by plain sums over the same nodes; alpha and beta ten times inside."""
        h = np.diff(worked.material)
        t, t0 = np.diff(y), np.diff(rest)
        d, X = t / h, float(worked.r0) / np.sqrt(t / h)
        middle = (rest[1:] + rest[:-1]) / 2
        more = np.where((middle >= 0.3) & (middle <= 0.7), 10.0, 1.0)
        p = np.cumsum(h) - h / 2
        a = np.diff(p)
        weight = a + np.concatenate([p[:1], 0 * a[2:], 1 - p[-1:]])
        pairs = (more[1:] + more[:-1]) / 2
        w = (np.append(0, h) + np.append(h, 0)) / 2
        gX, gY = np.diff(X) / a, np.diff(d) / a
        turn = np.diff((p[1:] + p[:-1]) / 2)
        total = SOFT.k / 2 * np.sum(h * (t / t0 - 1) ** 2) + SOFT.mu * np.sum(w * abs(y - rest))
        total += SOFT.alpha * (np.sum(more * h * d**2) + np.sum(pairs * weight * gX**2))
        bending = np.sum(more[1:-1] * np.diff(gX) ** 2 / turn) + np.sum(pairs * weight * gY**2)
        return total + SOFT.beta * bending

    least = energy(heights)
    assert least < energy(rest)
    rng = np.random.default_rng(5)
    for size in (1e-6, 1e-5, 1e-4):
        for _ in range(40):
            bump = size * np.exp(
                -(((worked.material - rng.uniform()) / rng.uniform(0.02, 0.3)) ** 2)
            )
            bump[0] = 0
            assert energy(heights + rng.choice([-1, 1]) * bump) > least - 1e-12
