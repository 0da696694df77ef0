"""Many squashes in few compiled calls: posed problems, and whole scenes to a tolerance."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxclay.clay.clay import Clay
from jaxclay.methods.choice import method_settings
from jaxclay.methods.newton import NewtonSettings
from jaxclay.model.material import Material
from jaxclay.model.squash import Squash, check_fits
from jaxclay.numerics.arrays import Array
from jaxclay.numerics.checks import check_tolerance, check_whole
from jaxclay.numerics.host import as_compiled, as_float64, compiled, in_float64
from jaxclay.schemes.problem import Problem
from jaxclay.schemes.rough import rough_start
from jaxclay.schemes.slices.posing import place
from jaxclay.solve.certified_newton import Answer, Packed, packed, program, solved, unpacked
from jaxclay.solve.minimize import minimize, newton_start, solution_of
from jaxclay.solve.refining import Plan, Wanted, on_slices, to_tolerance
from jaxclay.solve.solution import Solution
from jaxclay.solve.start import start_of

CAPACITY = 256  # problems of one call
_MANY = 64  # problems for which it pays to compile their rough shapes too


def minimize_batch(
    problems: Sequence[Problem], settings: Sequence[Any] | None = None, method: str = "newton"
) -> list[Solution]:
    """Minima of E_total (eq. 9) by one method: problems on as many slices in one compiled call.

    The call solves one problem after the other, each to its own end, so that nobody waits for a
    straggler.

    Parameters
    ----------
    problems : sequence of Problem
        From :func:`jaxclay.pose`, on slices of either scheme.
    settings : sequence of settings, optional
        The method's for each problem; its defaults if not given.
    method : str
        A key of :data:`jaxclay.METHODS`.

    Returns
    -------
    list of Solution
        In the order of the problems, each with its own status.

    Raises
    ------
    ValueError
        An unknown method, settings for another number of problems, a problem on splines.
    """
    default = method_settings(method, {})
    chosen = [default] * len(problems) if settings is None else list(settings)
    if len(chosen) != len(problems):
        raise ValueError(f"{len(chosen)} settings do not go with {len(problems)} problems")
    for i, problem in enumerate(problems):
        if problem.scheme == "spline":
            raise ValueError(
                f'problems[{i}] is on scheme "spline", but only "slices" and "paper" are solved in '
                "batches: give it to jaxclay.minimize"
            )
    return _solved([Wanted(problem, None) for problem in problems], chosen, method)


def deform_batch(
    scenes: Iterable[tuple[Clay, Squash, Material]],
    *,
    tolerance: float | None = None,
    slices: int | None = None,
) -> list[Solution]:
    """Squash many pieces of clay (eqs. 9 to 19): :func:`jaxclay.deform`, what is as fine at once.

    Parameters
    ----------
    scenes : iterable of (Clay, Squash, Material)
        What to squash.
    tolerance : float, optional
        Largest error of each contour, over the unit l.
    slices : int, optional
        How many slices each answer has instead; one of the two must be given.

    Returns
    -------
    list of Solution
        In the order of the scenes; to the certificate those of single calls.

    Raises
    ------
    ValueError
        What :func:`jaxclay.deform` raises, of the first scene that is wrong; both arguments or
        none.
    """
    if (tolerance is None) == (slices is None):
        raise ValueError(f"give a tolerance or slices: got {tolerance!r} and {slices!r}")
    if tolerance is not None:
        check_tolerance(tolerance)
    else:
        check_whole("slices", slices, 3)
    plans: list[Plan] = []
    for clay, squash, material in scenes:
        check_fits(squash, clay)
        found = place(clay, squash, material)
        if tolerance is not None:
            plans.append(to_tolerance(found, float(tolerance)))
        else:
            plans.append(on_slices(found, int(slices)))  # type: ignore[arg-type]
    return _followed(plans)


def _followed(plans: list[Plan]) -> list[Solution]:
    """What the plans return; what they ask for in each turn is solved at once."""
    ends: dict[int, Solution] = {}
    wanted = {i: next(plan) for i, plan in enumerate(plans)}
    while wanted:
        settings = [NewtonSettings()] * len(wanted)
        answers = dict(zip(wanted, _solved(list(wanted.values()), settings), strict=True))
        wanted = {}
        for i, answer in answers.items():
            try:
                wanted[i] = plans[i].send(answer)
            except StopIteration as end:
                ends[i] = end.value
    return [ends[i] for i in range(len(plans))]


def _solved(wanted: list[Wanted], settings: list[Any], method: str = "newton") -> list[Solution]:
    answers: dict[int, Solution] = {}
    shapes = [
        (one.problem.slices, one.problem.scheme, jax.tree.structure(chosen))
        for one, chosen in zip(wanted, settings, strict=True)
    ]
    for shape in dict.fromkeys(shapes):
        same = [i for i, other in enumerate(shapes) if other == shape]
        for first in range(0, len(same), CAPACITY):
            part = same[first : first + CAPACITY]
            these, theirs = [wanted[i] for i in part], [settings[i] for i in part]
            if method == "newton":
                found = _together(these, theirs)
            else:
                found = _by_method([one.problem for one in these], theirs, method)
            answers.update(zip(part, found, strict=True))
    return [answers[i] for i in range(len(wanted))]


def _together(wanted: list[Wanted], settings: list[NewtonSettings]) -> list[Solution]:
    problems = [each.problem for each in wanted]
    with as_compiled():
        if len(wanted) >= _MANY and all(each.start is None for each in wanted):
            pairs = list(zip(problems, settings, strict=True))
            count = np.array(len(pairs))
            found = in_float64("minimize", from_rough_shapes, stack(pairs, CAPACITY), count)
            each = zip(problems, _apart(found, len(pairs)), strict=True)
            return [dataclasses.replace(one, problem=problem) for problem, one in each]
        starts = [newton_start(each) for each in wanted]
        rows = [
            packed(problem.system, start, chosen, feasible)
            for problem, (start, feasible), chosen in zip(problems, starts, settings, strict=True)
        ]
        many = Packed(*(_stacked(leaves) for leaves in zip(*rows, strict=True)))
        answer = in_float64("minimize", programs, many, np.array(len(rows)))
        return [
            solution_of(
                problem,
                feasible,
                *unpacked(problem.system, Answer(*(leaf[i] for leaf in answer))),
                "newton",
            )
            for i, (problem, (_, feasible)) in enumerate(zip(problems, starts, strict=True))
        ]


def _by_method(problems: list[Problem], settings: list[Any], method: str) -> list[Solution]:
    """The answers of another method, from rough shapes that are compiled too."""
    pairs, count = list(zip(problems, settings, strict=True)), np.array(len(problems))
    found = in_float64("minimize", from_problems, stack(pairs, CAPACITY), count, method=method)
    return _apart(found, len(pairs))


def _apart(tree: Any, count: int) -> list[Any]:
    """The first ``count`` trees of one whose arrays have a leading axis."""
    leaves, structure = jax.tree.flatten(tree)
    rows = zip(*(list(leaf[:count]) for leaf in leaves), strict=True)
    return [jax.tree.unflatten(structure, row) for row in rows]


def stack(trees: list[Any], size: int | None = None) -> Any:
    """One tree of arrays with a leading axis, filled up to ``size`` with the last tree."""
    trees = trees + [trees[-1]] * ((size or len(trees)) - len(trees))
    return as_float64(jax.tree.map(lambda *leaves: np.stack(leaves), *trees))


def _stacked(leaves: tuple[np.ndarray, ...]) -> np.ndarray:
    """The arrays of all problems, padded to as many as one call takes."""
    whole = np.zeros((CAPACITY, *leaves[0].shape))
    whole[: len(leaves)] = leaves
    return whole


@compiled()
def programs(values: Packed, count: Array) -> Answer:
    """The first ``count`` of many calls of the program."""
    return _each(lambda i: program.traced(jax.tree.map(lambda leaf: leaf[i], values)), count)


@compiled()
def from_rough_shapes(pairs: tuple[Problem, NewtonSettings], count: Array) -> Solution:
    """The answers to problems with settings but for the problems, rough shapes compiled too."""

    def one(i: Any) -> Solution:
        problem, settings = jax.tree.map(lambda leaf: leaf[i], pairs)
        rough, feasible = rough_start(problem)
        start = start_of(problem, rough, None, "newton")
        found = solved(problem.system, start, settings, feasible)
        return dataclasses.replace(solution_of(problem, feasible, *found, "newton"), problem=None)

    return _each(one, count)


@compiled("method")
def from_problems(pairs: tuple[Problem, Any], count: Array, *, method: str) -> Solution:
    """The same for problems and the settings of another method."""

    def one(i: Any) -> Solution:
        problem, chosen = jax.tree.map(lambda leaf: leaf[i], pairs)
        names = (field.name for field in dataclasses.fields(chosen))
        return minimize(problem, method, **{name: getattr(chosen, name) for name in names})

    return _each(one, count)


def _each(one: Any, count: Array) -> Any:
    """The results of ``one`` for 0, 1 .. count - 1, padded to as many as one call takes."""

    def put(i, found):
        return jax.tree.map(lambda whole, leaf: whole.at[i].set(leaf), found, one(i))

    shapes = jax.eval_shape(one, 0)
    empty = jax.tree.map(lambda leaf: jnp.zeros((CAPACITY, *leaf.shape), leaf.dtype), shapes)
    return jax.lax.fori_loop(0, count.astype(int), put, empty)
