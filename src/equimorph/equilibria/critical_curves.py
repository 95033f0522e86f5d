"""Curves of critical states in two or more parameters: folds, branch points, cusps, bounds."""

from collections.abc import Sequence

from equimorph.equilibria.both_ways import CriticalCurve, both_ways
from equimorph.equilibria.conditions import (
    bound,
    branching,
    branchings,
    cubic,
    gap,
    grazing,
    limits,
    places,
    quadratic,
)
from equimorph.equilibria.following import Watch
from equimorph.equilibria.locus import Locus
from equimorph.equilibria.tracing import TraceOptions
from equimorph.errors import InputError
from equimorph.model import Box, Constraint
from equimorph.structures import State


def fold_curve(
    state: State,
    parameters: Sequence[str],
    *,
    on: Sequence[Constraint] = (),
    box: Box | None = None,
    within: Sequence[Constraint] = (),
    options: TraceOptions | None = None,
) -> CriticalCurve:
    """Follow folds in two parameters, both ways from `state`: the boundary of a stratum.

    ``F = 0, g = 0`` with g from a bordered system, so that every point is regular, cusps included
    [Govaerts2000]_; pseudo-arclength in (z, p). With constraints `on` their bounds, one more
    parameter each: where loss of stability and a bound coincide.

    Parameters
    ----------
    state
        A fold, like the end of a lift.
    parameters
        Names of the two (or more) parameters that vary.
    on
        Constraints that hold with equality all along.
    box
        Limits of some of the parameters; they end the curve.
    within
        Constraints whose violation ends the curve.
    options
        Step control.

    Raises
    ------
    InputError
        If `state` is no such state or lies outside, or for unknown or too few parameters.
    """
    structure = state.structure
    free = places(structure, parameters, 2 + len(on))
    watches = [Watch("cusp", quadratic), *branchings(structure, free)]
    locus = Locus(structure, state.p, free, (gap, *map(bound, on)))
    return both_ways("fold", locus, state, [*watches, *limits(state, free, box, within)], options)


def branch_curve(
    state: State,
    parameters: Sequence[str],
    *,
    along: str,
    box: Box | None = None,
    within: Sequence[Constraint] = (),
    options: TraceOptions | None = None,
) -> CriticalCurve:
    """Follow branch points of the paths along one parameter, both ways from `state`.

    ``F + βb = 0, g = 0, vᵀF_p = 0``. Branch points that persist by symmetry need two parameters
    (β stays zero); others need three.

    Parameters
    ----------
    state
        A branch point, like the end of a lift along the parameter `along`.
    parameters
        Names of the parameters that vary, `along` among them.
    along
        Parameter whose paths branch.
    box, within, options
        As for `fold_curve`.

    Raises
    ------
    InputError
        If `state` is no such branch point or lies outside, or for unknown parameters.
    """
    structure = state.structure
    unfolded = len(parameters) == 2
    free = places(structure, parameters, 2 if unfolded else 3)
    if along not in parameters:
        raise InputError(f"`along` must be one of the parameters that vary; got {along!r}.")
    locus = Locus(structure, state.p, free, (gap, branching(structure, along)), unfolded)
    watches = [Watch("degenerate", cubic, "the criticality changes")] if unfolded else []
    watches += limits(state, free, box, within)
    return both_ways("branch point", locus, state, watches, options)


def cusp_curve(
    state: State,
    parameters: Sequence[str],
    *,
    box: Box | None = None,
    within: Sequence[Constraint] = (),
    options: TraceOptions | None = None,
) -> CriticalCurve:
    """Follow cusps in three parameters, both ways: where two folds merge and a limit load jumps.

    ``F = 0, g = 0, vᵀF_zz[v, v] = 0``. For paths along one of the parameters these are hysteresis
    points: on one side of the curve the path has two folds more than on the other.

    Parameters
    ----------
    state
        A cusp, like those among the events of a `fold_curve`.
    parameters
        Names of the three parameters that vary.
    box, within, options
        As for `fold_curve`.

    Raises
    ------
    InputError
        If `state` is no cusp or lies outside, or for unknown parameters.
    """
    structure = state.structure
    free = places(structure, parameters, 3)
    watches = [Watch("swallowtail", cubic), *branchings(structure, free)]
    locus = Locus(structure, state.p, free, (gap, quadratic))
    return both_ways("cusp", locus, state, [*watches, *limits(state, free, box, within)], options)


def constraint_curve(
    state: State,
    parameters: Sequence[str],
    *,
    on: Sequence[Constraint],
    box: Box | None = None,
    within: Sequence[Constraint] = (),
    options: TraceOptions | None = None,
) -> CriticalCurve:
    """Follow states on the bounds of constraints, both ways from `state`.

    One constraint and two parameters: the boundary of what is allowed, for example where the
    unloaded structure violates it. Two constraints and three parameters: where the
    first one to be met changes.

    Parameters
    ----------
    state
        A state on all bounds, like the end of a lift.
    parameters
        Names of the parameters that vary: one more than constraints.
    on
        Constraints that hold with equality all along.
    box, within, options
        As for `fold_curve`.

    Raises
    ------
    InputError
        If `state` is not on the bounds or lies outside, or for unknown or too few parameters.
    """
    structure = state.structure
    free = places(structure, parameters, 1 + len(on))
    locus = Locus(structure, state.p, free, tuple(map(bound, on)), singular=False)
    return both_ways("constraint", locus, state, limits(state, free, box, within), options)


def grazing_curve(
    state: State,
    parameters: Sequence[str],
    *,
    on: Constraint,
    along: str,
    box: Box | None = None,
    within: Sequence[Constraint] = (),
) -> CriticalCurve:
    """Follow states where paths along one parameter touch a bound from inside, both ways.

    ``F = 0, c = 0, dc/ds = 0`` with s the length of the path: on one side of the curve the path
    ends at the bound, on the other it passes below.

    Parameters
    ----------
    state
        A state on the bound where c is largest along the path.
    parameters
        Names of the three parameters that vary, `along` among them.
    on
        The constraint.
    along
        Parameter whose paths touch the bound.
    box, within
        As for `fold_curve`.

    Raises
    ------
    InputError
        If `state` is no such state or lies outside, or for unknown parameters.
    """
    structure = state.structure
    free = places(structure, parameters, 3)
    tests = (bound(on), grazing(structure, on, along))
    locus = Locus(structure, state.p, free, tests, singular=False)
    return both_ways("grazing", locus, state, limits(state, free, box, within), None)
