"""Many actuators: narrow ways that random trees miss and slices show; how likely ways are missed.

Double wells ``E = u⁴/4 − a u²/2 − F u`` lead from one side to the other around the cusp a = F = 0,
so that the stable region of a box a ≥ −w is joined over a way of width w, and parted if a > 0.
"""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria import settle
from equimorph.tasks.planning.sampling import chance_of_missing, narrowest_excluded
from typecheck import unchecked

WIDTH = 0.004


def structure(energy, unknowns, actuators):
    """An energy of double wells."""
    return em.EnergyStructure(
        energy,
        [em.Unknown(name, 0.0, (-2.0, 2.0)) for name in unknowns],
        [em.Parameter(name, "1", 1.0, "actuator", 0.0) for name in actuators],
    )


def state(wells, u, p):
    """Equilibrium near u."""
    found = settle(wells, np.array([u], float), np.array([p], float))
    return em.State(wells, found.z[0], np.array(p, float))


@pytest.fixture(scope="module")
def pair():
    """Two double wells side by side, each with a and F of its own, both to be turned over."""
    energy = " + ".join(f"u{i}**4/4 - a{i}*u{i}**2/2 - F{i}*u{i}" for i in (1, 2))
    wells = structure(energy, ("u1", "u2"), ("a1", "F1", "a2", "F2"))
    return [state(wells, [side, side], [1.0, 0.0, 1.0, 0.0]) for side in (1, -1)]


def test_a_slice_finds_the_narrow_way_that_trees_miss():
    """The way is 0.4 % of the range of a wide; c moves the cusp to a = c²/4 and is not needed."""
    well = structure("u**4/4 - a*u**2/2 - F*u + c*u**3/3", ("u",), ("a", "F", "c"))
    ends = [state(well, [side], [1.0, 0.0, 0.0]) for side in (1, -1)]
    box = em.Box(a=(-WIDTH, 1.0), F=(-0.2, 0.2), c=(-0.5, 0.5))
    with unchecked():
        missed, found = (
            em.plan_sampled(*ends, box, options=em.SamplingOptions(lifts=1000, slices=slices))
            for slices in (0, 1)
        )
    assert not missed.arrived
    assert found.arrived


@pytest.mark.slow
def test_slices_find_the_narrow_way_of_two_wells_side_by_side(pair):
    """Each well has to pass 0.4 % of the range of its a, which trees miss."""
    box = em.Box(a1=(-WIDTH, 1.0), F1=(-0.2, 0.2), a2=(-WIDTH, 1.0), F2=(-0.2, 0.2))
    with unchecked():
        missed, found = (
            em.plan_sampled(*pair, box, options=em.SamplingOptions(lifts=2000, slices=slices))
            for slices in (0, 2)
        )
    assert not missed.arrived
    assert found.arrived
    turns = found.states.p[np.abs(found.states.z).argmin(axis=0)]
    assert (turns[[0, 1], [0, 2]] < 0.0).all()


@pytest.mark.slow
@pytest.mark.parametrize("low", [-0.02, 0.02])
@pytest.mark.parametrize("parts", [3, 4, 5])
def test_slices_through_reached_states_find_what_two_actuators_cannot_do(parts, low):
    """a = a₁ + a₂ + … falls below 0 only if all but F of 4, 5, 6 actuators are near their ends."""
    names = [f"a{i}" for i in range(parts)]
    wells = structure(f"u**4/4 - ({' + '.join(names)})*u**2/2 - F*u", ("u",), (*names, "F"))
    ends = [state(wells, [side], [0.4] * parts + [0.0]) for side in (1, -1)]
    box = em.Box(**dict.fromkeys(names, (low, 0.4)), F=(-0.2, 0.2))
    with unchecked():
        route = em.plan_sampled(*ends, box, options=em.SamplingOptions(lifts=1, slices=8 * parts))
    assert route.arrived == (low < 0.0)


@pytest.mark.slow
@pytest.mark.parametrize(("strongest", "able"), [(20.0, False), (50.0, True)])
def test_four_tendons_lead_an_arm_over_as_far_as_two_couples_do(strongest, able):
    """Tendons at ±0.1 of the axis pull only; what they do are two couples of either sign.

    A set over these two answers the same question by itself.
    """
    couples = {"k1": em.Curvature(1.0, 0.0, 0.5), "k2": em.Curvature(1.0, 0.5, 1.0)}
    tendons = {
        f"T{2 * half + (offset < 0) + 1}": em.Tendon(offset, 0.5 * half, 0.5 * half + 0.5)
        for half in (0, 1)
        for offset in (0.1, -0.1)
    }
    answers, given = [], {"theta_A": np.pi / 2, "P": 2.8}
    with unchecked():
        for actuators in (couples, tendons):
            arm = em.Rod(ends=("clamped", "free"), actuators=actuators, EI=1.0, length=1.0,
                         loads={"P": em.PointForce(1.0)})  # fmt: skip
            within, tip = [arm.max_curvature <= 12], arm.position(1.0)[0]
            names = list(actuators)
            sides = (0.0, strongest) if len(names) == 4 else (-0.1 * strongest, 0.1 * strongest)
            rest = given | dict.fromkeys(names[2:], 0.0)
            first = em.Box(**dict.fromkeys(names[:2], sides))
            eset = em.equilibrium_set(arm, first, fixed=rest, within=within, intervals=(16, 16))
            stable = eset.at(**dict.fromkeys(names[:2], 0.0)).stable
            ends = min(stable, key=tip), max(stable, key=tip)
            if len(names) == 2:
                answers.append(em.plan(eset, *ends).arrived)
            else:
                options = em.SamplingOptions(lifts=1, slices=8)
                box = em.Box(**dict.fromkeys(names, sides))
                route = em.plan_sampled(*ends, box, within=within, options=options)
                answers.append(route.arrived)
    assert answers == [able, able]


@pytest.mark.parametrize(("actuators", "rounds", "batch"), [(2, 25, 8), (3, 25, 64)])
def test_the_chance_of_missing_a_corridor_is_that_of_simulated_samples(actuators, rounds, batch):
    """Balls along a straight corridor, met in turn, one in a round; four standard errors."""
    width, length, trials = 0.8, 0.6, 2000
    radius, rng = width / 8.0, np.random.default_rng(1)
    count = int(np.ceil(length / radius))
    balls = np.full((count, actuators), 0.5)
    balls[:, 0] = 0.2 + radius * np.arange(count)
    met = np.zeros(trials, int)
    for _ in range(rounds):
        samples = rng.uniform(size=(trials, batch, actuators))
        gap = np.linalg.norm(samples - balls[np.minimum(met, count - 1)][:, None], axis=2)
        met += (gap.min(axis=1) <= radius) & (met < count)
    missed = float((met < count).mean())
    exact = chance_of_missing(width, length, actuators, rounds, batch, np.inf)
    assert 0.05 < exact < 0.95
    assert missed == pytest.approx(exact, abs=4.0 * np.sqrt(exact * (1.0 - exact) / trials))


def test_more_samples_exclude_narrower_corridors():
    """The width of 5 % falls with the rounds, and none is excluded by a few."""
    widths = [narrowest_excluded(2, rounds, 128, 0.25) for rounds in (1, 30, 1000)]
    assert widths[0] is None
    assert widths[2] < widths[1]
    assert chance_of_missing(widths[2], 1.0, 2, 1000, 128, 0.25) <= 0.05


def test_a_refusal_says_what_the_lifts_exclude(pair):
    box = em.Box(a1=(0.1, 1.0), F1=(-0.2, 0.2))
    with unchecked():
        few, many = (
            em.plan_sampled(*pair, box, options=em.SamplingOptions(lifts=lifts, slices=0))
            for lifts in (256, 5120)
        )
    assert few.why.endswith("exclude no corridor as long as a range, not even the widest")
    assert "of it wide would have been missed with a probability of 0.05 at most" in many.why
