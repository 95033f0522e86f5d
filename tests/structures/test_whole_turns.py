"""States that are the same but for whole turns of what nothing holds are one to searches."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import ellipe, ellipk

from equimorph import (
    Box,
    End,
    EnergyStructure,
    Frame,
    LineLoad,
    Parameter,
    Rod,
    Unknown,
    equilibrium_set,
    find_equilibria,
)
from equimorph.structures import from_identity
from oracles import spatial_frames
from oracles.specimens import portal


def strut() -> Frame:
    """A column, and a member hinged at both of its ends."""
    return Frame(
        {"A": (0, 0), "B": (0, 1), "C": (1, 1)},
        [("A", "B"), {"ends": ("B", "C"), "hinges": ["B", "C"]}],
        {"A": "fixed", "C": "xy"},
        {"P": {"B": (0.0, -1.0)}},
    )


def sprung_strut() -> Frame:
    """A column on a coil spring, and a member hinged at both of its ends."""
    return Frame(
        {"A": (0, 0), "B": (0, 1), "C": (1, 1)},
        [("A", "B"), {"ends": ("B", "C"), "hinges": ["B", "C"]}],
        {"A": {"x": "held", "y": "held", "angle": 3.0}, "C": "xy"},
        {"P": {"B": (0.0, -1.0)}},
    )


def pendulum(springs: float = 0.0) -> EnergyStructure:
    """Two equal links that hang, turned by a couple at their pin; angles of both, and between."""
    energy = "-2*g*cos(a) - g*cos(a + b) + k*(1 - cos(b)) - M*a"
    angles = [Unknown(name, period=2.0 * np.pi) for name in ("a", "b")]
    given = {"g": 1.0, "k": springs, "M": 0.0}
    parameters = [Parameter(name, "1", 1.0, "load", value) for name, value in given.items()]
    return EnergyStructure(energy, angles, parameters, coercive=True)


TURNING = {
    "pendulum": (pendulum, 2, 0),
    "strut": (strut, 1, 0),
    "sprung strut": (sprung_strut, 1, 1),
    "hinges in space": (spatial_frames.shed, 2, 0),
    "pinned rod": (lambda: Rod(ends=("pinned", "pinned"), loads={"q": LineLoad()}), 1, 0),
    "rolling rod": (lambda: Rod(ends=("pinned", End("free", "free", "held"))), 1, 0),
    "sprung rod": (lambda: Rod(ends=(End(2.0, "held", "held"), "pinned")), 0, 1),
    "clamped rod": (Rod, 0, 0),
}


@pytest.mark.parametrize("name", TURNING)
def test_copies_balance_like_states_and_are_taken_back(name):
    made, count, sprung = TURNING[name]
    structure = made()
    whole = structure.whole_turns
    turns = whole.free
    assert (turns.shape, len(whole.sprung)) == ((count, structure.size), sprung)
    p = np.tile([0.3 if each.default is None else each.default for each in structure.parameters],
                (8, 1))  # fmt: skip
    z = structure.sample(p, np.random.default_rng(0))
    before, back = structure.residual(z, p), whole.taken_back(z)
    for turn in (*(3.0 * turns), *-turns):
        change = np.abs(structure.residual(z + turn, p) - before).max()
        assert change < 1e-11 * np.abs(before).max()
        np.testing.assert_allclose(whole.taken_back(z + turn), back, atol=1e-12)
    for turn in whole.sprung:
        change = structure.residual(z + turn, p) - before
        assert np.count_nonzero(np.abs(change[0]) > 1e-9 * np.abs(before).max()) == 1  # its spring
    share = back @ turns.T / (turns**2).sum(axis=1)
    assert (np.abs(share) < 0.54).all()


def elastica(span: float) -> float:
    """Modulus of the inflectional elastica whose ends are so far apart, of length 1.

    One half wave: 2E(k)/K(k) − 1 is the distance, 4kK(k) the largest curvature; n half waves have
    n times this curvature, and index n − 1 between pins (Love, section 263).
    """
    return brentq(lambda m: 2.0 * ellipe(m) / ellipk(m) - 1.0 - span, 1e-9, 0.999)


def test_a_rod_between_pins_has_two_states_of_each_number_of_waves():
    """It was told to have 24 states, three of each, and six of them stable."""
    m = elastica(0.8)
    curvature = 4.0 * np.sqrt(m) * ellipk(m)
    rod = Rod(ends=("pinned", "pinned"))
    found = find_equilibria(rod, {"nu": 0.8}, within=[rod.max_curvature <= 14.0])
    assert 4.0 * curvature < 14.0 < 5.0 * curvature
    order = np.argsort(rod.max_curvature(found))
    np.testing.assert_array_equal(found.index[order], np.repeat(np.arange(4), 2))
    waves = np.repeat(np.arange(1, 5), 2) * curvature
    np.testing.assert_allclose(rod.max_curvature(found)[order], waves, rtol=1e-6)
    assert [str(each.standing) for each in found.arguments[:2]] == ["holds", "holds"]


def test_a_set_of_a_rod_between_pins_has_no_copies():
    rod = Rod(ends=("pinned", "pinned"))
    eset = equilibrium_set(
        rod, Box(nu=(0.75, 0.85)), within=[rod.max_curvature <= 10.0], intervals=(2,)
    )
    assert eset.audit.clean
    # curvatures of three half waves lie within the bound at .85, of two at .75
    over = [eset.over(nu=[span]).states for span in (0.751, 0.849)]
    assert [sorted(each.index.tolist()) for each in over] == [
        np.repeat(np.arange(int(10.0 // (4.0 * np.sqrt(m) * ellipk(m)))), 2).tolist()
        for m in map(elastica, (0.751, 0.849))
    ]


def test_a_set_has_one_copy_of_sheets_that_pass_half_a_turn():
    """The line between the pins turns past π: what searches find on both sides is one sheet."""
    rod = Rod(ends=("pinned", "pinned"))
    eset = equilibrium_set(
        rod,
        Box(rise=(-0.3, 0.3)),
        fixed={"nu": -0.4},
        within=[rod.max_curvature <= 7.0],
        intervals=(6,),
    )
    assert eset.audit.clean
    m = elastica(0.5)
    assert 4.0 * np.sqrt(m) * ellipk(m) < 7.0
    assert eset.over(rise=[-0.3, 0.0, 0.3]).states.index.tolist() == [0] * 6


@pytest.mark.parametrize("couple", [0.0, 1.2, -2.7])
def test_a_pendulum_of_two_links_has_four_states_until_its_couple_turns_it_over(couple):
    """Each link stands or hangs: M = 2g sin a + g sin(a + b), 0 = sin(a + b). It had dozens."""
    made = pendulum()
    found = find_equilibria(made, {"g": 1.0, "k": 0.0, "M": couple})
    turns = [np.arcsin(couple / 2.0)] if abs(couple) < 2.0 else []
    true = [(a, b) for turn in turns for a in (turn, np.pi - turn) for b in (0.0, np.pi)]
    assert len(found) == len(true)
    for a, b in true:
        gap = np.exp(1j * found.z) - np.exp(1j * np.array([a, b - a]))
        assert np.abs(gap).max(axis=1).min() < 1e-8
    assert sorted(found.index.tolist()) == [0, 1, 1, 2][: len(true)]
    last = str(found.arguments[-1])
    assert last.startswith("sum of indices: holds if the promise does (Σ(−1)^index = 0, must be 0")
    assert from_identity(made.identity()).whole_turns.free.shape == (2, 2)


def test_a_set_of_a_pendulum_has_one_copy_of_each_sheet():
    eset = equilibrium_set(pendulum(), Box(M=(-0.3, 0.4)), fixed={"g": 0.7, "k": 0.4})
    assert eset.audit.clean
    found = find_equilibria(pendulum(), {"g": 0.7, "k": 0.4, "M": 0.25})
    assert eset.over(M=[0.25]).states.index.tolist() == found.index.tolist()


@pytest.mark.slow
def test_a_set_of_a_frame_with_a_hinge_is_no_lattice_of_copies():
    """Searches met ever more turns of the hinge: it was refused as a set without end."""
    frame = spatial_frames.shed(elements=2, degree=6)
    eset = equilibrium_set(
        frame,
        Box(a=(-0.1497, 0.1097)),
        fixed={"b": -0.1666, "P": -0.0477, "q": 0.0},
        within=[frame.max_curvature <= 1.86],
        intervals=(26,),
    )
    assert eset.audit.clean
    assert len(eset.points) == 27


def test_a_set_has_no_piece_twice_where_a_loose_member_turns_past_half_a_turn():
    """Two copies met over no vertex of the coarse grid; three seeds of six had both."""
    frame = portal(50.0, elements=2, degree=8)
    eset = equilibrium_set(
        frame,
        Box(k=(-0.9908, 0.7716), P=(-4.1388, 4.9227)),
        fixed={"d": 0.0594, "q": -1.4731},
        within=[frame.max_curvature <= 2.15],
        intervals=(10, 14),
        seed=3,
    )
    for k, P in ((-0.9, -3.7), (-0.5, -1.5), (-0.198, -0.061)):
        energy = np.sort(eset.at(k=k, P=P).energy)
        assert np.diff(energy).min(initial=np.inf) > 1e-6
    assert eset.audit.clean
    assert len(eset.at(k=-0.198, P=-0.061)) == 2
