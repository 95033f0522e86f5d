"""Distances of the spring from its stability boundary x_l = cos³ δ, F/k = sin³ δ; the arch."""

import numpy as np
import pytest
from scipy.integrate import quad, solve_ivp
from scipy.optimize import minimize_scalar
from scipy.sparse import coo_array
from scipy.sparse.csgraph import dijkstra

from equimorph.equilibria import lift
from equimorph.errors import InputError
from equimorph.manifold import equilibrium_set, stability_distance
from equimorph.manifold.geometry.setting import embed
from equimorph.manifold.geometry.topology import faces_of, keys_of
from equimorph.manifold.queries.snap_graph import stability_boundary
from equimorph.model import Box
from equimorph.structures import Spring, State
from sets import arch_set, spring_set
from typecheck import unchecked


def upper(eset, **at):
    here = eset.at(**at).stable
    return here[int(here.z[:, 0].argmax())]


def test_distances_over_one_parameter():
    """x_l = 0.7: F at the fold; the arclength of the curve F(δ), by quadrature."""
    with unchecked():
        eset = equilibrium_set(
            Spring(), Box(F=(-0.5, 0.5)), fixed={"x_l": 0.7}, intervals=(9,), checks=0
        )
    state = upper(eset, F=0.0)
    fold = np.arccos(np.cbrt(0.7))
    distance = stability_distance(eset, state)
    assert distance.in_parameters == pytest.approx(np.sin(fold) ** 3, abs=1e-8)
    length, _ = quad(lambda t: np.hypot(1, np.cos(t) - 0.7 / np.cos(t) ** 2), fold, state.z[0])
    # chains of 8 and 16 links, extrapolated: of fourth order
    assert distance.along_the_set == pytest.approx(length, rel=1e-4)
    assert distance.way.z[-1, 0] == pytest.approx(fold, abs=1e-5)


@pytest.mark.parametrize(("x", "force"), [(0.7, 0.0), (0.8, 0.05), (1.2, 0.1), (0.5, -0.2)])
def test_distances_in_two_parameters(spring_set, x, force):
    """Least distance from the astroid (cos³ δ, sin³ δ) for δ > 0: the upper branch ends there."""
    with unchecked():
        distance = stability_distance(spring_set, upper(spring_set, x_l=x, F=force))
    t = np.linspace(0.0, 1.3, 200_001)
    gap = np.hypot(np.cos(t) ** 3 - x, np.sin(t) ** 3 - force)
    assert distance.in_parameters == pytest.approx(gap.min(), abs=1e-8)
    nearest = distance.nearest
    assert nearest["x_l"] == pytest.approx(np.cos(nearest.z[0]) ** 3, abs=1e-8)


@pytest.mark.parametrize("stiffness", [1e-3, 1.0, 4.0])
@pytest.mark.parametrize(("x", "force"), [(0.7, 0.0), (0.6, -0.15), (0.75, -0.05)])
def test_folds_of_the_other_branch_do_not_count_in_any_unit(stiffness, x, force):
    """Least distance from F = k sin³ δ, δ > 0; F = −k sin³ δ is nearer, but the lower branch's.

    Both branches belong to one stratum, and all margins are proportional to k.
    """
    with unchecked():
        eset = equilibrium_set(
            Spring(),
            Box(x_l=(0.3, 1.3), F=(-0.5 * stiffness, 0.5 * stiffness)),
            fixed={"k": stiffness},
            intervals=(12, 13),
            checks=0,
        )
        state = upper(eset, x_l=x, F=force * stiffness)
        distance = stability_distance(eset, state)

    def least(sign: float) -> float:
        def gap(t):
            return np.hypot(np.cos(t) ** 3 - x, stiffness * (sign * np.sin(t) ** 3 - force))

        t = np.linspace(0.0, 1.3, 2001)
        nearest = np.clip(np.argmin(gap(t)), 1, len(t) - 2)
        bounds = t[nearest - 1], t[nearest + 1]
        return minimize_scalar(gap, bounds=bounds, method="bounded", options={"xatol": 1e-12}).fun

    assert distance.in_parameters == pytest.approx(least(1.0), abs=1e-9)
    assert force == 0.0 or least(-1.0) < 0.999 * least(1.0)
    assert distance.nearest.z[0] > 0.0


def geodesic_length(delta: float, x: float, bearing: float) -> float:
    """Length from (δ, x_l) to x_l = cos³ δ along a geodesic of (δ, x_l, F(δ, x_l)), by its ODE.

    With one graph coordinate F: q̈ = −F_ij q̇ⁱ q̇ʲ ∇F / (1 + |∇F|²).
    """

    def slopes(d, x):
        return np.array([np.cos(d) - x / np.cos(d) ** 2, -np.tan(d)])

    def rate(_, y):
        d, x, v, w = y
        gradient = slopes(d, x)
        second = -np.sin(d) - 2 * x * np.sin(d) / np.cos(d) ** 3
        bend = second * v * v - 2 * v * w / np.cos(d) ** 2
        a = -bend * gradient / (1 + gradient @ gradient)
        return [v, w, *a]

    def folded(_, y):
        return y[1] - np.cos(y[0]) ** 3

    folded.terminal = True
    v = np.array([np.cos(bearing), np.sin(bearing)])
    v = v / np.sqrt(v @ v + (slopes(delta, x) @ v) ** 2)
    end = solve_ivp(rate, (0, 3), [delta, x, *v], events=folded, rtol=1e-8, atol=1e-10)
    return float(end.t_events[0][0]) if len(end.t_events[0]) else 3.0


@pytest.mark.parametrize(
    ("x", "force"),
    [
        (0.8, 0.05),
        pytest.param(0.7, 0.0, marks=pytest.mark.slow),
        pytest.param(0.5, -0.2, marks=pytest.mark.slow),
    ],
)
def test_shortest_way_along_the_surface_of_the_spring(spring_set, x, force):
    """Shooting geodesics in all directions. 1e-4: fourth order in 16 links."""
    state = upper(spring_set, x_l=x, F=force)
    bearings = np.linspace(0, 2 * np.pi, 25)
    lengths = [geodesic_length(state.z[0], x, each) for each in bearings]
    best = bearings[int(np.argmin(lengths))]
    exact = minimize_scalar(
        lambda t: geodesic_length(state.z[0], x, t), (best - 0.2, best, best + 0.2), tol=1e-6
    ).fun
    with unchecked():
        distance = stability_distance(spring_set, state)
    assert distance.along_the_set == pytest.approx(exact, rel=1e-4)
    assert distance.along_the_set >= distance.in_parameters
    assert distance.way.residual.max() < 1e-9


def test_chains_that_become_one_when_they_are_finer():
    """Three ways with eight links, of which two lead to the same point with 16: x_l = 1.3."""
    eset = spring_set()
    lengths = []
    with unchecked():
        for force in (-0.5, 0.5):
            state = eset.at(x_l=1.3, F=force).stable[0]
            lengths.append(stability_distance(eset, state).along_the_set)
    assert lengths[0] == pytest.approx(lengths[1], rel=1e-4)


@pytest.mark.slow
def test_no_straight_move_of_the_arch_loses_stability_before():
    """Lifts in 48 directions end no earlier; the one to the nearest fold ends there."""
    eset = arch_set((24, 41))
    arch = eset.structure
    with unchecked():
        for state in eset.at(Theta=1.0, Delta=0.0).stable:
            distance = stability_distance(eset, state)
            for bearing in np.linspace(0, 2 * np.pi, 48, endpoint=False):
                move = 0.999 * distance.in_parameters * np.array([np.cos(bearing), np.sin(bearing)])
                move *= arch.scales[[list(state.parameters).index(n) for n in eset.names]]
                goal = {"Theta": 1.0 + move[0], "Delta": move[1]}
                path = lift(state, to=goal)
                assert path.end.kind == "arrived"
                assert path.end.state.stable
            nearest = {name: distance.nearest[name] for name in eset.names}
            beyond = {
                name: state[name] + 1.01 * (value - state[name]) for name, value in nearest.items()
            }
            path = lift(state, to=beyond)
            assert path.end.kind == "fold"
            assert path.end.at == pytest.approx(1 / 1.01, abs=1e-5)


def shortest_over_triangles(eset, state, stratum: int) -> float:
    """Length to the stability boundary over straight triangles, between points on their sides.

    Five points on each side, 6600 vertices: up to 3.4 % too long.
    """
    setting = eset.setting
    cells, x = eset.cells[eset.stratum == stratum], embed(setting, eset.points.z, eset.points.p)
    sides = faces_of(cells, 2)
    share = np.linspace(0.0, 1.0, 7)[1:-1, None]
    between = x[sides[:, :1]] * (1 - share) + x[sides[:, 1:]] * share
    number = len(x) + np.arange(5 * len(sides)).reshape(-1, 5)
    keys = keys_of(sides, len(x))
    on_sides = [
        number[np.searchsorted(keys, keys_of(cells[:, pair], len(x)))]
        for pair in ([0, 1], [0, 2], [1, 2])
    ]
    around = np.concatenate([cells, *on_sides], axis=1)
    places = np.concatenate([x, between.reshape(-1, x.shape[1])])
    one, other = np.triu_indices(around.shape[1], 1)
    pairs = np.unique(
        keys_of(np.stack([around[:, one], around[:, other]], 2).reshape(-1, 2), len(places))
    )
    pairs = np.stack(np.divmod(pairs, len(places)))
    length = np.linalg.norm(places[pairs[0]] - places[pairs[1]], axis=1)
    graph = coo_array((length, pairs), shape=(len(places),) * 2).tocsr()
    here = eset.over(**{name: np.array([state[name]]) for name in eset.names})
    own = eset.cells[here.cell[np.abs(here.states.z - state.z).max(axis=1).argmin()]]
    first = np.linalg.norm(x[own] - embed(setting, state.z[None], state.p[None]), axis=1)
    far = dijkstra(graph, directed=False, indices=own) + first[:, None]
    return float(far[:, np.unique(stability_boundary(eset, stratum))].min())


@pytest.mark.slow
def test_shortest_ways_along_the_arch_against_a_graph_of_its_triangles():
    """Dijkstra between points on all sides of the triangles, which is at most 5 % too long."""
    eset = arch_set((24, 41), accuracy=0.003)
    with unchecked():
        for theta, delta in [
            (1.0, 0.0),
            (1.3, 0.5),
            (0.471, -0.79),
            (1.903, 0.246),
            (1.258, -1.021),
        ]:
            here = eset.over(Theta=np.array([theta]), Delta=np.array([delta]))
            for lane in np.flatnonzero(here.index == 0):
                state, stratum = here.states[int(lane)], int(here.stratum[lane])
                length = stability_distance(eset, state).along_the_set
                graph = shortest_over_triangles(eset, state, stratum)
                assert 0.95 * graph < length < 1.002 * graph


def test_a_stratum_without_folds_is_nowhere_unstable():
    with unchecked():
        eset = equilibrium_set(Spring(), Box(F=(-0.3, 0.3)), fixed={"x_l": 1.2}, intervals=(5,))
    distance = stability_distance(eset, eset.at(F=0.1)[0])
    assert (distance.in_parameters, distance.along_the_set) == (np.inf, np.inf)
    assert distance.nearest is None


def test_states_that_have_no_such_distance_are_refused(spring_set):
    here = spring_set.at(x_l=0.8, F=0.0)
    with pytest.raises(InputError, match="`state` must be stable; got one of index 1"):
        stability_distance(spring_set, here[int(here.index.argmax())])
    other = Spring().natural_state(x_l=0.8, k=2.0)
    with pytest.raises(InputError, match="must have the fixed parameters of the set"):
        stability_distance(spring_set, other)


def test_a_state_is_of_the_set_if_it_differs_by_round_off_only(spring_set):
    """By at most 1e-4 in the metric: the root of round-off, by which states move next to folds."""
    state = upper(spring_set, x_l=0.8, F=0.0)
    exact = stability_distance(spring_set, state).in_parameters

    def moved(z: float = 0.0, k: float = 0.0) -> State:
        p = state.p + k * (np.array([each.name for each in spring.parameters]) == "k")
        return State(spring, state.z + z / np.sqrt(spring.mass), p)

    spring = state.structure
    for near in (moved(z=1e-9), moved(k=1e-10)):
        assert stability_distance(spring_set, near).in_parameters == pytest.approx(exact, abs=1e-8)
    for off in (3e-4, -3e-4, 1e-2):
        with pytest.raises(InputError, match=r"`state` must be a state of the set; got .*, which"):
            stability_distance(spring_set, moved(z=off))
    with pytest.raises(InputError, match="must have the fixed parameters of the set"):
        stability_distance(spring_set, moved(k=1e-8))
