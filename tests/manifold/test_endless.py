"""No set is lifted without end: what winds for ever is refused, what multiplies is stopped."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import EndlessError
from equimorph.manifold.lifting import flood
from equimorph.manifold.lifting.endless import refuse_copies
from typecheck import unchecked


def test_a_set_that_winds_for_ever_is_refused(monkeypatch):
    monkeypatch.setattr(flood, "ENDLESS", 12)
    load = em.Parameter("p", "1", 1.0, "load")
    winding = em.EnergyStructure("-cos(1.4142135623730951*theta) - p*theta", ["theta"], [load])
    said = (
        r"`within` must leave at most 12 equilibria over a point; got more over p = .* endless set"
    )
    with unchecked(), pytest.raises(EndlessError, match=said):
        em.equilibrium_set(winding, em.Box(p=(-2, 2)), intervals=(3,))


def winding_twice() -> em.EnergyStructure:
    """A pendulum that winds, and a spring: whole turns of θ alone lead to the same state."""
    load = em.Parameter("p", "1", 1.0, "load")
    return em.EnergyStructure("-cos(theta) - p*theta + (x - p)**2/2", ["theta", "x"], [load])


def test_a_state_that_whole_turns_repeat_is_refused_early_and_by_name():
    """Six copies are enough where more turns violate no constraint."""
    said = r"`within` must bound whole turns: over p = .* 6 times, and without end"
    with unchecked(), pytest.raises(EndlessError, match=said):
        em.equilibrium_set(winding_twice(), em.Box(p=(-2, 2)), intervals=(3,))


def test_a_state_that_whole_turns_repeat_as_often_as_a_bound_lets_them_is_lifted():
    angle = em.Descriptor("angle", "1", lambda z, p: np.abs(z[:, 0]))
    with unchecked():
        eset = em.equilibrium_set(
            winding_twice(), em.Box(p=(-0.5, 2)), intervals=(9,), within=[angle <= 25.0]
        )
        turned = eset.over(p=[0.3]).states.z[:, 0]
    assert eset.audit.clean
    # sin θ = p: −25 to 25 holds eight of each of both branches
    own = np.concatenate([np.arcsin(0.3) + 2 * np.pi * np.arange(-4, 5)])
    other = np.pi - np.arcsin(0.3) + 2 * np.pi * np.arange(-5, 5)
    true = np.concatenate([own, other])
    true = true[np.abs(true) <= 25.0]
    np.testing.assert_allclose(np.sort(turned), np.sort(true), atol=1e-9)


def winding_in(angle: em.Unknown) -> em.EnergyStructure:
    """A pendulum that does not wind as |p| < 1; its load does no work in turns."""
    load = em.Parameter("p", "1", 1.0, "load")
    return em.EnergyStructure(f"-cos({angle.name}) - p*sin({angle.name})", [angle], [load])


def turned(eset, turns: int) -> em.States:
    """States of a set, with their first unknown changed by whole turns."""
    z = eset.points.z.copy()
    z[:, 0] += 2.0 * np.pi * turns
    return em.States(eset.structure, z, eset.points.p)


@pytest.mark.parametrize("turns", [1, -2])
def test_one_copy_that_a_check_finds_is_enough_where_more_turns_lead_to_more(turns, monkeypatch):
    """tan θ = p: after six turns and a hundred, states are equilibria as before."""
    monkeypatch.setattr(flood, "are_repeated", lambda *_: False)
    winding = winding_in(em.Unknown("theta", "0"))
    angle = em.Descriptor("angle", "1", lambda z, p: np.abs(z[:, 0]))
    given = {"box": em.Box(p=(-0.5, 0.5)), "intervals": (3,), "checks": 0}
    with unchecked():
        eset = em.equilibrium_set(winding, **given)
        bounded = em.equilibrium_set(winding, **given, within=[angle <= 30.0])
        said = r"`within` must bound whole turns: over p = .* 6 times, and without end"
        with pytest.raises(EndlessError, match=said):
            refuse_copies(eset, turned(eset, turns))
        refuse_copies(bounded, turned(bounded, turns))


def test_states_a_turn_apart_are_no_copies_where_further_turns_lead_to_none():
    """(x − p)(x − p − π)(x − p − 2π) has three roots, the first and the last a turn apart."""
    load = em.Parameter("p", "1", 1.0, "load")
    t = "(x - p)"
    energy = f"{t}**4/4 - pi*{t}**3 + pi**2*{t}**2"
    roots = em.EnergyStructure(energy, [em.Unknown("x", "p", guesses=(-1.0, 7.5))], [load])
    with unchecked():
        eset = em.equilibrium_set(roots, em.Box(p=(-0.5, 0.5)), intervals=(3,))
        refuse_copies(eset, turned(eset, 1))
    assert eset.audit.clean
    assert eset.audit.components == 3


def test_copies_that_are_no_other_states_are_not_refused():
    """Of an angle with a period, a set has one copy."""
    winding = winding_in(em.Unknown("theta", "0", period=2.0 * np.pi))
    with unchecked():
        eset = em.equilibrium_set(winding, em.Box(p=(-0.5, 0.5)), intervals=(3,))
        refuse_copies(eset, turned(eset, 1))
    assert eset.audit.clean
    assert eset.audit.components == 2


def test_a_set_larger_than_its_limit_is_returned_as_far_as_it_is_known():
    """The audit says where lifting stopped; what is there are equilibria all the same."""
    box = em.Box(x_l=(0.6, 1.3), F=(-0.5, 0.5))
    eset = em.equilibrium_set(em.Spring(), box, intervals=(20, 20), checks=0, limit=500)
    assert 500 < eset.audit.stopped < 900
    assert not eset.audit.clean
    assert ("lifting stopped", f"at {eset.audit.stopped} equilibria: no room within the limit") in (
        eset.audit.rows()
    )
    assert eset.points.residual.max() < 1e-9
    assert em.equilibrium_set(em.Spring(), box, intervals=(6, 6), checks=0).audit.stopped == 0


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"intervals": (10**6, 10**6)}, r"at most 1000000 points of the grid, .* give 1e\+12\."),
        ({"intervals": (20, 20), "limit": 50}, r"at most 50 points of the grid, .* give 441\."),
        (
            {"checks": 10**12},
            r"`checks` must be a whole number from 0 to 100000; got 1000000000000",
        ),
    ],
)
def test_absurd_sizes_are_refused_before_the_start(options, message):
    with pytest.raises(em.InputError, match=message):
        em.equilibrium_set(em.Spring(), em.Box(x_l=(0.6, 1.3), F=(-0.5, 0.5)), **options)


@pytest.mark.slow
def test_sheets_that_cross_along_the_diagonal_of_a_square_box():
    """E' = (x−3)(x−p)(x−r): x = p and x = r cross where p = r, with which no grid line coincides.

    The crossing leaves through two corners of the box.
    """
    parameters = [em.Parameter(name, "1", 1.0, "actuator", 0.0) for name in "pr"]
    energy = "x**4/4 - (3+p+r)*x**3/3 + (3*p+3*r+p*r)*x**2/2 - 3*p*r*x"
    crossed = em.EnergyStructure(energy, [em.Unknown("x", "3", guesses=(-2.5, 3.5))], parameters)
    eset = em.equilibrium_set(crossed, em.Box(p=(-1, 1), r=(-1, 1)), intervals=(14, 14))
    assert eset.audit.clean
    p, r = np.random.default_rng(0).uniform(-0.9, 0.9, (2, 200))
    over = eset.over(p=p, r=r)
    for k in range(200):
        found = np.sort(over.states.z[over.point == k, 0])
        np.testing.assert_allclose(found, np.sort([p[k], r[k], 3.0]), atol=1e-8)
