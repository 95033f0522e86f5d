"""Questions of a study on energy: barriers of the spring are known at F = 0, ½ (1 − x_l)²."""

import numpy as np
import pytest

import equimorph as em
from equimorph.study.lookup import Extent, Ground, constraints_of
from studies import SPRING_SET, answered, answered_again, page, rows_of

QUESTIONS = """\
[[transition_network]]
name = "here"
at = { x_l = 0.8, F = 0.0 }

[[transition_network]]
name = "alone"
at = { x_l = 1.2, F = 0.0 }

[[barriers]]
name = "all"

[[route]]
name = "guarded"
start = { at = { x_l = 0.8, F = 0.0 }, highest = "angle" }
goal = { at = { x_l = 0.8, F = 0.0 }, lowest = "angle" }
within = ["barrier >= 0.01"]

[[least_shock]]
name = "knock"
state = { at = { x_l = 0.8, F = 0.0 }, highest = "angle" }
step = 0.2
"""


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    return answered(tmp_path_factory.mktemp("energy"), SPRING_SET + QUESTIONS)


def test_the_page_tells_barriers_and_where_they_lead(run):
    outcome, out = run
    network = outcome.of("transition_network")["here"]
    heights = [network.barrier(each).energy for each in network.states[network.minima]]
    assert heights == pytest.approx([0.02, 0.02], abs=1e-9)
    told = page(out)
    assert "<strong>2 stable states</strong>, 1 saddle; the least barrier is 0.02." in told
    assert "<strong>1 stable state</strong>, 0 saddles; nothing to snap to." in told
    assert outcome.of("least_shock")["knock"].barrier.energy == pytest.approx(0.02, abs=1e-9)
    for end in ("tree.png", "path.png", "film.gif"):
        assert (out / f"here-transition_network-{end}").exists()


def test_barriers_over_the_set_are_those_of_settings(run):
    """At F = 0, x_l = 0.5 it is ⅛; white where there is nothing to snap to, at x_l > 1."""
    outcome, out = run
    least, state, most = outcome.of("barriers")["all"]
    assert least.shape == (81, 81)
    assert least[40, 0] == pytest.approx(0.125, abs=1e-9)
    assert (least[:, -30:] < 0.0).all()
    assert most.status == "landed"
    assert most.energy > least.max()
    head, row = rows_of(out / "all-barriers.csv")
    assert float(row[head.index(next(x for x in head if x.startswith("barrier")))]) == most.energy
    assert state.stable


def test_barriers_over_one_parameter_have_no_figure(tmp_path):
    """There is no plane to draw them in; at x_l = 0.8 and F = 0 the barrier is 0.02."""
    line = """
title = "Over the force alone"
[structure]
kind = "spring"
[set]
box = { F = [-0.1, 0.1] }
fixed = { x_l = 0.8 }
within = ["angle <= 1.2", "angle >= -1.2"]
[[barriers]]
name = "all"
"""
    outcome, out = answered(tmp_path, line)
    _, _, most = outcome.of("barriers")["all"]
    assert most.energy > 0.02
    assert (out / "all-barriers.csv").exists()
    assert not list(out.glob("all-barriers*.png"))


def test_barriers_are_a_name_in_other_questions(run):
    """Along the guarded route the barrier stays above its bound.

    Under errors of x_l by 0.005 the least barrier at (0.8, 0) is ½ (1 − 0.805)².
    """
    outcome, out = run
    field, route = em.barriers(outcome.equilibrium_set), outcome.of("route")["guarded"][0]
    assert route.arrived
    assert field.of(route.states).energy.min() > 0.01 * (1.0 - 1e-6)
    assert (out / "explorer.html").exists()
    erring = em.worst_over(field.eset.structure, field.descriptor, {"x_l": 0.005}, sense="min")
    assert erring(route.states[[0, -1]]) == pytest.approx([0.0190125] * 2, abs=1e-9)


HARD = """\
[[route]]
name = "hardest"
start = { at = { x_l = 0.8, F = 0.0 }, highest = "angle" }
goal = { at = { x_l = 0.8, F = 0.0 }, lowest = "angle" }
objective = "least(barrier)"

[[route]]
name = "erring"
start = { at = { x_l = 0.8, F = 0.0 }, highest = "angle" }
goal = { at = { x_l = 0.8, F = 0.0 }, lowest = "angle" }
within = ["lowest(barrier for x_l +- 0.005) >= 0.01"]
"""


@pytest.mark.slow
def test_no_route_keeps_more_than_the_barrier_of_its_ends(tmp_path):
    """That is 0.02, up to the slack, by default 1e-3; errors of x_l leave what a bound asks for."""
    outcome, _ = answered(tmp_path, SPRING_SET + HARD)
    field = em.barriers(outcome.equilibrium_set)
    hardest, erring = (outcome.of("route")[name][0] for name in ("hardest", "erring"))
    assert hardest.bottleneck.value == pytest.approx(0.02, abs=1e-9)
    assert field.of(hardest.states).energy.min() > 0.02 * (1.0 - 1e-3)
    ends, keep = (hardest.states[0], hardest.states[-1]), em.least(field.descriptor, slack=1e-6)
    strict = em.plan(field.eset, *ends, objective=keep)
    assert field.of(strict.states).energy.min() > 0.02 * (1.0 - 1e-6)
    lowest = em.worst_over(field.eset.structure, field.descriptor, {"x_l": 0.005}, sense="min")
    assert lowest(erring.states).min() > 0.01 * (1.0 - 1e-6)


def test_barriers_have_units_and_need_a_set():
    rod = em.Rod(span=0.95, EI=0.01, length=1.0)
    extent = Extent(em.Box(Theta=(0.0, 1.0)), {}, (), (2,))
    (bound,) = constraints_of(Ground(rod, extent), ["barrier >= 2 mJ"], "route[0].within")
    assert bound.bound == pytest.approx(2e-3)
    with pytest.raises(em.InputError, match=r"in `route\[0\].within\[0\]`"):
        constraints_of(Ground(rod, None), ["barrier >= 2 mJ"], "route[0].within")


def test_answers_are_read_from_their_folder(run):
    outcome, out = run
    again = answered_again(out.parent / "spring.toml", out)
    for table in ("transition_network", "barriers", "least_shock"):
        assert again.of(table).keys() == outcome.of(table).keys()
    before, after = (each.of("transition_network")["here"] for each in (outcome, again))
    np.testing.assert_array_equal(before.states.z, after.states.z)
    np.testing.assert_array_equal(before.ends, after.ends)
    shocks = [each.of("least_shock")["knock"].shocks[0].value for each in (outcome, again)]
    assert shocks[0] == shocks[1]
