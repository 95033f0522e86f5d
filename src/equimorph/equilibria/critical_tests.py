"""Conditions on curves of critical states: what vanishes along them, and what ends them; states."""

from collections.abc import Callable, Sequence

import numpy as np

from equimorph.arrays import Directions, Int, Lanes, Parameters, Values
from equimorph.equilibria.critical import Critical, Test
from equimorph.equilibria.lift import check_start
from equimorph.equilibria.locus_events import Watch
from equimorph.equilibria.point_conditions import Vanishing
from equimorph.equilibria.settle import Guards, Settled, settle
from equimorph.equilibria.trace_options import EventKind
from equimorph.errors import InputError
from equimorph.model import Box, Constraint, position
from equimorph.structures import State, Structure
from equimorph.structures.metric import move_length

TestsOf = Callable[[Int[np.ndarray, " some"]], Sequence[Test]]
"""Tests of some lanes, by their numbers: as many as parameters vary."""
NEARBY = Guards(iterations=10, longest=np.inf, too_long=0.5, converged=1e-9)
"""The guesses are close: longer corrections, in the metric, lead elsewhere."""
TEST_DIFFERENCE = 1e-6
"""Step of differences of tests, in the metric: it sets the rate of Newton, not the error."""


def correct_singular_states(
    structure: Structure, z: Lanes, p: Parameters, directions: Directions, tests: TestsOf
) -> Settled:
    """States near guesses at which as many tests vanish as parameters vary.

    Newton's method on F = 0 and the tests, in a basis of the kernel of [F_z F_p] that is regular at
    folds, branch points and cusps.

    Parameters
    ----------
    structure
        The structure.
    z, p
        Guesses.
    directions
        Changes of the parameters that vary, for each lane, orthonormal in their scales.
    tests
        Tests that vanish on the lanes with given numbers; see
        `equimorph.equilibria.critical_tests`.
    """
    vanishing = Vanishing(tests, np.arange(len(z)), TEST_DIFFERENCE, one_sided=True, at_null=True)
    return settle(structure, z, p, directions, [vanishing], NEARBY)


def places(structure: Structure, names: Sequence[str], count: int) -> Int[np.ndarray, " k"]:
    """Columns of `count` different parameters."""
    found = [position(structure.parameters, name) for name in names]
    if len(found) != count or len(set(found)) != count:
        raise InputError(f"`parameters` must be {count} different names; got {list(names)!r}.")
    return np.array(found)


def gap(at: Critical) -> Values:
    """g: zero at singular states."""
    return at.g


def quadratic(at: Critical) -> Values:
    """vᵀF_zz[v, v]: zero at cusps."""
    return at.quadratic


def cubic(at: Critical) -> Values:
    """Cubic coefficient: zero at swallowtails and where criticality changes."""
    return at.cubic


def branching(structure: Structure, name: str) -> Test:
    """vᵀF_p for one parameter: zero where its paths branch."""
    place = position(structure.parameters, name)

    def test(at: Critical) -> Values:
        dp = np.zeros_like(at.p)
        dp[:, place] = structure.scales[place]
        return at.along(dp)

    return test


def bound(constraint: Constraint) -> Test:
    """Excess over a bound, relative to it."""
    size = constraint.size
    return lambda at: constraint.excess(at.z, at.p) / size


def grazing(structure: Structure, constraint: Constraint, name: str) -> Test:
    """Change of a constraint along the path in one parameter, per unit length."""
    place = position(structure.parameters, name)
    size, step = constraint.size, 1e-4

    def test(at: Critical) -> Values:
        dp = np.zeros_like(at.p)
        dp[:, place] = structure.scales[place]
        column = structure.parameter_derivative(at.z, at.p, dp)
        dz = -structure.solve(at.z, at.p, column[:, None]).x[:, 0]
        h = step / move_length(structure, dz, dp)[:, None]
        dz, dp = h * dz, h * dp
        ahead, behind = (constraint.excess(at.z + s * dz, at.p + s * dp) for s in (1.0, -1.0))
        return np.asarray((ahead - behind) / (2.0 * step * size))

    return test


def branchings(structure: Structure, free: Int[np.ndarray, " k"]) -> list[Watch]:
    """Watches for branch points of the paths along each free parameter."""
    names = [structure.parameters[place].name for place in free]
    return [Watch(EventKind.BRANCH_POINT, branching(structure, name), name) for name in names]


def limits(
    state: State, free: Int[np.ndarray, " k"], box: Box | None, within: Sequence[Constraint]
) -> list[Watch]:
    """Watches that end a curve: the box, the limits of the parameters' meaning, constraints."""
    check_start(state, within)
    watches = [Watch(EventKind.CONSTRAINT, bound(c), str(c), ends=True) for c in within]
    for place in free:
        parameter = state.structure.parameters[place]
        low, high = parameter.lower, parameter.upper
        if box is not None and parameter.name in box.names:
            at = box.names.index(parameter.name)
            low, high = max(low, box.lower[at]), min(high, box.upper[at])
        value = state.p[place]
        if not low - 1e-12 <= value <= high + 1e-12:
            raise InputError(
                f"`state` must lie in the box; got {parameter.name} = {value:g} "
                f"outside {low:g} to {high:g}."
            )
        for side, sign in ((low, -1.0), (high, 1.0)):
            if np.isfinite(side):
                test = _beyond(int(place), float(side), sign, parameter.scale)
                detail = f"{parameter.name} = {side:g}"
                watches.append(Watch(EventKind.BOX, test, detail, ends=True))
    return watches


def _beyond(place: int, bound: float, sign: float, scale: float) -> Test:
    return lambda at: sign * (at.p[:, place] - bound) / scale
