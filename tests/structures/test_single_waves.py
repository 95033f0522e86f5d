"""Nearly straight rods have many flat states, and guesses hold as many waves as elements resolve.

A pinned rod without a load has two states for each number m of half waves with 4mkK(k) ≤ max |κ|,
where 2E(k)/K(k) − 1 is the distance of its ends over its length (Love, Mathematical Theory of
Elasticity, §263; unit length).
"""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

import equimorph as em
from equimorph.structures.rod.waves import single_waves


def pinned_states(span: float, bound: float) -> int:
    """Number of states in closed form, but those whose ends have changed places."""
    k = brentq(lambda k: 2.0 * ellipe(k * k) / ellipk(k * k) - 1.0 - span, 1e-6, 0.9)
    return 2 * int(bound / (4.0 * k * ellipk(k * k)))


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("span", "bound"), [(0.9, 20.0), (0.95, 30.0), (0.97, 30.0), (0.98, 20.0)])
def test_all_states_of_a_nearly_straight_pinned_rod_are_found(span, bound, seed):
    """18, 42, 54 and 44 states; without single waves 40 to 44 of the 54 were found."""
    rod = em.Rod(ends=("pinned", "pinned")).resolving(bound, reach=span)
    at, within = {"q": 0.0, "nu": span, "rise": 0.0}, [rod.max_curvature <= bound]
    assert len(em.find_equilibria(rod, at, within=within, seed=seed)) == pinned_states(span, bound)


@pytest.mark.slow
def test_a_set_of_a_nearly_straight_pinned_rod_has_all_states():
    """46 to 94 states; the set lacked four of the last, and took over ten minutes."""
    rod = em.Rod(ends=("pinned", "pinned")).resolving(30.0, reach=0.99)
    box, within = em.Box(nu=(0.96, 0.99)), [rod.max_curvature <= 30.0]
    eset = em.equilibrium_set(
        rod, box, fixed={"q": 0.0, "rise": 0.0}, within=within, intervals=(20,)
    )
    assert eset.audit.clean
    for span in (0.9601, 0.975, 0.9899):
        assert len(eset.at(nu=span)) == pinned_states(span, 30.0)


def test_guesses_on_default_elements_are_no_single_waves():
    """They take no random numbers either: searches find what they found."""
    generator, untouched = np.random.default_rng(0), np.random.default_rng(0)
    lanes, waves, thrusts = single_waves(em.Rod().mesh, (True, True), 200, generator)
    assert len(lanes) == len(waves) == len(thrusts) == 0
    assert generator.uniform() == untouched.uniform()


@pytest.mark.parametrize(
    "ends", [("pinned", "pinned"), ("clamped", "pinned"), ("pinned", "clamped")]
)
def test_single_waves_meet_the_conditions_at_the_ends(ends):
    """No turn at a clamp, no curvature at a pin: cos changes in second order to the next node."""
    rod = em.Rod(ends=ends, elements=18)
    held = tuple(end == "clamped" for end in ends)
    lanes, waves, thrusts = single_waves(rod.mesh, held, 300, np.random.default_rng(1))
    assert len(np.unique(lanes)) == 100
    assert thrusts.max() > 100.0
    for end, inner, is_held in ((0, 1, held[0]), (-1, -2, held[1])):
        turn = waves[:, end] if is_held else waves[:, inner] - waves[:, end]
        step = np.abs(rod.mesh.nodes[inner] - rod.mesh.nodes[end])
        allowed = 1e-12 if is_held else 0.8 * (2.0 * np.pi) ** 2 * thrusts * step**2
        assert (np.abs(turn) <= allowed).all()
