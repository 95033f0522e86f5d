"""The paper's arch made of round rods and of strips: values of three independent computations."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import equimorph as em
from equimorph.structures.rod.space import quartic
from oracles.spatial_rod import sideways_from

ROUND = 1.0 / 1.3
"""C = 1/(1 + ν) at ν = 0.3, as all tables but where they say so."""
SPAN = np.sin(1.0)


def states(settings, load="uniform", torsion=ROUND, lateral=1.0):
    """Natural states at (Θ, Δ)."""
    rod = em.Rod(load, torsion=torsion, lateral=lateral)
    found, all_there = rod.natural_states(np.array([(*each, 0.0, SPAN) for each in settings]))
    assert all_there.all()
    return rod, found


LOADS = {
    "uniform": {
        (0.6, 0.0): 1.125177, (0.75, 0.0): 1.366285, (0.9, 0.0): 1.601472, (0.96, 0.0): 1.695477,
        (1.0, 0.0): 1.758548, (1.2, 0.0): 2.086648, (1.5, 0.0): 2.693904, (0.9, 0.02): 1.601348,
        (0.9, 0.04): 1.600980, (0.94, 0.6): 1.637928, (0.65, 0.52): 1.110689,
    },
    "left-half": {
        (0.9, 0.0): 1.534254, (0.96, 0.0): 1.626933, (0.94, 0.6): 1.596116, (0.65, 0.52): 1.149830,
    },
}  # fmt: skip


@pytest.mark.parametrize("load", LOADS)
def test_a_round_arch_leaves_its_plane_far_below_its_planar_limit_load(load):
    """First lateral loads by a code of rods in space; half of the last digit given."""
    rod, natural = states(LOADS[load], load)
    found = em.limit_load(natural, "q", within=[rod.stable_in_space])
    np.testing.assert_allclose(found.value, list(LOADS[load].values()), atol=5.1e-7)
    assert set(found.kind.tolist()) == {"lateral branch point"}
    assert set(found.criticality.tolist()) == {"supercritical"}


def test_the_first_lateral_load_does_not_depend_on_the_torsional_stiffness_if_round():
    """(0.9, 0), A = 1: 1.601471549048 for C from 0.5 to 0.77, to 2e-11."""
    for torsion in (0.5, 0.6, 0.77):
        rod = em.Rod(torsion=torsion, lateral=1.0)
        state = rod.natural_state(Theta=0.9)
        found = em.limit_load(state, "q", within=[rod.stable_in_space])
        assert found.value == pytest.approx(1.601471549048, abs=2e-11)
        assert abs(rod.lateral_margin()(found.state)) < 1e-12


def test_the_lateral_margin_far_beyond_is_that_of_the_rod_in_space():
    """(0.9, 0), q = 4, A = 1: −1.14060993087 = −1.14060993 of a spatial rod; half a last digit."""
    rod = em.Rod(torsion=0.77, lateral=1.0)
    state = em.lift(rod.natural_state(Theta=0.9), {"q": 4.0}).end.state
    assert rod.lateral_margin()(state) == pytest.approx(-1.14060993087, abs=5e-12)
    assert state.margin == pytest.approx(0.11903064, abs=5e-9)
    assert state.multipliers[0] == pytest.approx(1.80440904, abs=5e-9)
    assert state.stable
    assert state.stable_in_space == "unstable"


def test_a_round_rod_leaves_its_plane_without_a_snap():
    """q(z(½)) = 1.601557, 1.607025, 1.777788 at 0.005, 0.04, 0.18, index 0: last digit."""
    rod = em.Rod(torsion=0.77, lateral=1.0)
    found = em.limit_load(rod.natural_state(Theta=0.9), "q", within=[rod.stable_in_space])
    assert found.criticality == "supercritical"
    at = sideways_from(rod, found.state, 0.77, 1.0)
    for place, exact in ((0.005, 1.601557), (0.04, 1.607025), (0.1, None), (0.18, 1.777788)):
        load, spectrum, _ = at(place)
        assert spectrum[0] > 0.0
        assert exact is None or load == pytest.approx(exact, abs=5.1e-7)


@pytest.mark.parametrize(
    ("lateral", "Theta", "Delta", "word"),
    [
        (1.0, 0.9, 0.0, "supercritical"),
        (2.0, 0.9, 0.0, "supercritical"),
        (2.5, 0.9, 0.0, "subcritical"),
        (1.5, 0.6, 0.3, "subcritical"),
    ],
)
def test_a_rod_in_space_follows_the_side_that_criticality_tells(lateral, Theta, Delta, word):
    """q − q₀ = b z² + O(z⁴) by fourth-order terms and by two equilibria in space: 1e-5."""
    rod = em.Rod(torsion=0.77, lateral=lateral)
    state = rod.natural_state(Theta=Theta, Delta=Delta)
    found = em.limit_load(state, "q", within=[rod.stable_in_space])
    assert found.criticality == word
    at, bends = sideways_from(rod, found.state, 0.77, lateral), []
    for place in (0.01, 0.02):
        load, spectrum, _ = at(place)
        bends.append((load - found.value) / place**2)
        assert (spectrum < 0.0).sum() == int(word == "subcritical")
    h, z, p = 1e-3, found.state.z[None], found.state.p[None]
    ends = [em.lift(state, {"q": found.value + side * h}).end.state for side in (-1.0, 1.0)]
    slope = (rod.lateral_margin()(ends[1]) - rod.lateral_margin()(ends[0])) / (2 * h)
    middle = rod.lateral_mode(found.state, 3).z[1]
    bend = -4.0 * quartic(rod.out_of_plane(), z, p)[0][0] / slope / middle**2
    assert bend == pytest.approx((4 * bends[0] - bends[1]) / 3, rel=1e-4)


def inverted(Theta, load):
    """The inverted round arch under a load."""
    rod = em.Rod(torsion=0.77, lateral=1.0)
    z, p = (each[-1] for each in inverted_route())
    state = em.State(rod, z, p)
    return rod, em.lift(state, {"q": load, "Theta": Theta}).end.state


def test_the_sideways_branch_rejoins_the_inverted_arch():
    """(0.9, 0): at q₀ = 2.476483, z² = 0.1096 (q₀ − q); at 2.1 (y, z) = (−0.0385, 0.184)."""
    rod, state = inverted(0.9, 3.0)
    assert state.stable_in_space
    end = em.lift(state, {"q": 2.0}, within=[rod.stable_in_space]).end
    assert (end.kind, end.criticality) == ("lateral branch point", "supercritical")
    assert end.state["q"] == pytest.approx(2.476483, abs=5.1e-7)
    at = sideways_from(rod, end.state, 0.77, 1.0)
    load, spectrum, _ = at(0.01)
    assert 0.01**2 / (2.476483 - load) == pytest.approx(0.1096, abs=1e-3)
    assert spectrum[0] > 0.0
    for place in (0.05, 0.1, 0.15, 0.184):
        load, spectrum, middle = at(place)
        assert spectrum[0] > 0.0
    assert load == pytest.approx(2.1, abs=4e-3)  # of half a last digit of z
    assert middle[1] == pytest.approx(-0.0385, abs=1.3e-3)


def test_where_both_planar_states_are_unstable_in_space_a_sideways_pair_is_stable():
    """(1, 0), q = 2.5: middle at (−0.07768, ±0.15005), margin 0.1035; to the digits given."""
    rod, state = inverted(1.0, 3.0)
    end = em.lift(state, {"q": 2.0}, within=[rod.stable_in_space]).end
    at = sideways_from(rod, end.state, 0.77, 1.0)
    for place in (0.02, 0.06, 0.1, 0.13, 0.15005):
        load, spectrum, middle = at(place)
    assert load == pytest.approx(2.5, abs=3e-5)  # of half a last digit of z
    assert middle[1] == pytest.approx(-0.07768, abs=1.2e-5)
    assert spectrum[0] == pytest.approx(0.1035, abs=5.7e-5)


@cache
def inverted_route():
    """Way-points of the paper's route from upright to inverted at q = 2.5: 65 planar states."""
    rod = em.Rod()
    state = em.lift(rod.natural_state(Theta=1.0), {"q": 2.5}).end.state
    corners = [(1.0, 0.0), (1.3, 0.0), (1.3, 1.3), (1.0, 1.3), (1.0, 0.0)]
    found = [state]
    for (a, b), (c, d) in pairwise(corners):
        for k in range(1, 17):
            to = {"Theta": a + (c - a) * k / 16, "Delta": b + (d - b) * k / 16}
            state = em.lift(state, to).end.state
            found.append(state)
    z, p = np.array([each.z for each in found]), np.array([each.p for each in found])
    assert (rod.index(z, p) == 0).all()
    return z, p


def lowest(torsion, lateral):
    rod = em.Rod(torsion=torsion, lateral=lateral)
    return rod.lateral_margin().function(*inverted_route())


def test_a_round_rod_cannot_go_the_papers_way_from_upright_to_inverted():
    """Index 1 on the first 25 and the last 12 of 65 stations, 0 between; lowest −0.342."""
    rod = em.Rod(torsion=0.77, lateral=1.0)
    index = rod.out_of_plane().index(*inverted_route())
    np.testing.assert_array_equal(index, [1] * 25 + [0] * 28 + [1] * 12)
    margins = lowest(0.77, 1.0)
    assert margins.min() == pytest.approx(-0.342, abs=5e-4)
    assert margins[0] == pytest.approx(-0.3424, abs=5e-5)
    assert margins[-1] == pytest.approx(-0.0765, abs=5e-5)


@pytest.mark.parametrize(
    ("ratio", "exact"), [(2.0, 0.355), (10**0.5, 0.467), (10.0, 0.572), (40.0, 0.604)]
)
def test_strips_can_go_the_papers_way(ratio, exact):
    """Lowest lateral eigenvalue on the route, ν = 0.3, C = 2/(1 + ν) (1 − 0.63 t/w); last digit."""
    torsion = 2.0 / 1.3 * (1.0 - 0.63 / ratio)
    assert lowest(torsion, ratio**2).min() == pytest.approx(exact, abs=6e-4)


@pytest.mark.parametrize(("torsion", "exact"), [(0.77, 1.4745), (1.0, 1.4715), (1.4, 1.4687)])
def test_the_papers_way_is_stable_in_space_from_a_ratio_of_stiffnesses_on(torsion, exact):
    """Smallest A for which the whole route is stable: between the neighbours of the last digit."""
    assert lowest(torsion, exact + 1.1e-4).min() > 0.0 > lowest(torsion, exact - 1.1e-4).min()


@pytest.mark.parametrize(
    ("torsion", "to_load", "to_pitchfork"),
    [(0.5, 1.5835, 2.8670), (0.77, 1.5708, 2.7901), (1.0, 1.5649, 2.7543), (1.45, 1.5585, 2.7140)],
)
def test_the_arch_stays_in_its_plane_up_to_a_load_from_a_ratio_on(torsion, to_load, to_pitchfork):
    """(0.9, 0): smallest A up to q = 2.5 and up to the planar pitchfork; last digit."""
    for load, exact in ((2.5, to_load), (4.24399, to_pitchfork)):
        ends = []
        for side in (-1.0, 1.0):
            rod = em.Rod(torsion=torsion, lateral=exact + side * 1e-4)
            path = em.lift(rod.natural_state(Theta=0.9), {"q": load}, within=[rod.stable_in_space])
            ends.append(path.end.kind)
        assert ends == ["lateral branch point", "arrived"]


@pytest.mark.slow
def test_of_the_stable_states_of_the_set_a_part_is_stable_in_space():
    """q = 2.5, 24 × 41, max |κ| ≤ 20: 72.1, 86.4, 95.9 and 100 % of 882 vertices; one vertex.

    The source names A alone; with C from 0.77 (round) to 1.0, as here, every digit agrees.
    """
    arch = em.Rod()
    eset = em.equilibrium_set(
        arch, em.Box(Theta=(0.2, 2.5), Delta=(-2.0, 2.0)), fixed={"q": 2.5},
        within=[arch.max_curvature <= 20.0], intervals=(24, 41),
    )  # fmt: skip
    stable = eset.points[eset.index == 0]
    assert len(stable) == 882
    stiffnesses = ((0.77, 1.0), (0.9, 1.5), (1.0, 2.0), (1.0, 3.0))
    for (torsion, lateral), share in zip(stiffnesses, (0.721, 0.864, 0.959, 1.0), strict=True):
        index = em.Rod(torsion=torsion, lateral=lateral).out_of_plane().index(stable.z, stable.p)
        assert (index == 0).mean() == pytest.approx(share, abs=1.0 / 882)


@pytest.mark.slow
@pytest.mark.parametrize(("torsion", "lateral", "possible"), [(0.77, 1.0, False), (0.9, 2.0, True)])
def test_sets_that_are_stable_in_space_hold_the_ways_that_are(torsion, lateral, possible):
    """q = 2.5: nothing is left over (1, 0) for a round rod; at A = 2, C = 0.9 a way inside out."""
    rod = em.Rod(torsion=torsion, lateral=lateral)
    eset = em.equilibrium_set(
        rod, em.Box(Theta=(0.2, 2.5), Delta=(-2.0, 2.0)), fixed={"q": 2.5},
        within=[rod.max_curvature <= 20.0, rod.stable_in_space], intervals=(24, 41),
    )  # fmt: skip
    assert eset.audit.clean
    assert rod.lateral_margin()(eset.points).min() > -1e-8
    over = eset.at(Theta=1.0, Delta=0.0)
    assert len(over) == (2 if possible else 0)
    if possible:
        states = over[np.argsort(rod.height(0.5)(over))]
        route = em.plan(eset, states[1], states[0], margin=0.1)
        assert route.arrived
        assert rod.lateral_margin()(route.path.states).min() > 0.0
