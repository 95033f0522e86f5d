"""The paper's arch made of round rods and of strips: values of three independent computations."""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest

import equimorph as em
from equimorph.structures.rod.criticality import quartic

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
    """q(z(½)) of the branch in space: 1.601557 at 0.005, 1.607025 at 0.04.

    On the branch q − q₀ = b z² + O(z⁴); b by extrapolation from both, to the digits given.
    """
    rod = em.Rod(torsion=0.77, lateral=1.0)
    found = em.limit_load(rod.natural_state(Theta=0.9), "q", within=[rod.stable_in_space])
    assert found.criticality == "supercritical"
    block, z, p = rod.out_of_plane(), found.state.z[None], found.state.p[None]
    h, ends = 1e-3, []
    for side in (-1.0, 1.0):
        state = em.lift(rod.natural_state(Theta=0.9), {"q": found.value + side * h}).end.state
        ends.append(rod.lateral_margin()(state))
    slope = (ends[1] - ends[0]) / (2 * h)
    middle = rod.lateral_mode(found.state, 3).z[1]
    b = -4.0 * quartic(block, z, p)[0][0] / slope / middle**2
    near, far = (1.601557 - found.value) / 0.005**2, (1.607025 - found.value) / 0.04**2
    assert b == pytest.approx((64 * near - far) / 63, abs=0.02)  # 5e-7/0.005²
    assert b == pytest.approx(far, rel=0.02)


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
