"""The gallery of networks: what its examples and study files compute."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import equimorph as em
from equimorph.study.prepare import prepare
from equimorph.study.problem import parse_study
from typecheck import unchecked

EXAMPLES = Path(__file__).parents[1] / "examples"


def structure(name):
    """The structure of a study file."""
    text = (EXAMPLES / f"{name}.toml").read_text(encoding="utf-8")
    return prepare(parse_study(text, name)).structure


def example(name):
    spec = spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.slow
def test_lees_frame_is_led_around_its_snap():
    """Limits as printed, to half a unit of the last digit."""
    module = example("lee")
    with unchecked():
        found = module.main((9, 9))
        assert isinstance(module.figure(found), Axes)
    assert found.limits == pytest.approx((18.5588, -9.4213), abs=6e-5)
    assert found.eset.audit.clean
    assert found.route.status == "arrived"
    assert found.route.margin >= 0.2


def test_the_bridge_keeps_its_middle_level_while_the_load_grows():
    """1e-9: descriptors are held to that."""
    module = example("bridge")
    with unchecked():
        found = module.main((7, 7))
        assert isinstance(module.figure(found), Figure)
    truss = module.bridge()
    assert found.sag < -0.1
    assert found.eset.audit.clean
    assert found.level.end.kind == "arrived"
    middle = truss.displacement("b3", "y")(found.level.states)
    np.testing.assert_allclose(middle, 0.0, atol=1e-9)
    assert (truss.max_utilisation(found.level.states) <= 1.0).all()


def test_study_file_and_example_describe_the_same_bridge():
    """Bars may be listed in another order: limit loads agree to round-off."""
    safe = [
        (made, [made.max_utilisation <= 1])
        for made in (structure("bridge"), example("bridge").bridge())
    ]
    with unchecked():
        one, two = (
            em.limit_load(made.natural_state(), "F", within=cap).value for made, cap in safe
        )
    assert one == pytest.approx(two, rel=1e-9)


def test_the_network_stays_where_it_is_put():
    """Two stable states without load; the study file has the same limit load. 1e-9: round-off."""
    made = structure("network")
    with unchecked():
        found = em.find_equilibria(made, {"t": 0.0, "P": 0.0}, within=[made.max_curvature <= 2])
        here = em.limit_load(made.natural_state(), "P").value
        there = em.limit_load(example("network").network().natural_state(), "P").value
    np.testing.assert_array_equal(found.index, [0, 0])
    assert here == pytest.approx(there, rel=1e-9)


def test_the_network_snaps_over_at_its_fold():
    """One way it comes to rest inverted, the other way is held: the second softest mode is slow."""
    rest = structure("network").natural_state()
    with unchecked():
        fold = em.lift(rest, {"P": 30.0}).end
        landings = {each.status: each for each in em.snap_landing(fold.state)}
    assert fold.kind == "fold"
    assert set(landings) == {"landed", "held"}
    height = rest.structure.displacement("M2", "y")
    assert height(landings["landed"].state) < -0.6
    assert landings["landed"].released > 1.0


@pytest.mark.slow
def test_the_network_is_pressed_over_and_pulled_back():
    """The loads that its study file names, to four digits."""
    module = example("network")
    with unchecked():
        found = module.main()
        assert isinstance(module.figure(found), Figure)
    assert found.loads == pytest.approx((14.2530, -14.0613), abs=6e-5)
    assert found.inverted.stable
    assert found.eset.audit.clean


@pytest.mark.slow
def test_the_set_of_the_network_is_clean_for_sharper_bends():
    """Up to |κ| = 3.2 there are 14 pieces, of degree 8 as of degree 9 on another grid.

    Beyond |κ| = 3 degree 7 leaves states out that it does not resolve. Over the middle of the box a
    search of another seed finds no equilibrium beside those of the sheets.
    """
    box = em.Box(t=(-0.5, 0.5), P=(-4.0, 4.0))
    for degree, intervals in ((8, (5, 5)), (9, (6, 7))):
        frame = example("network").network(degree)
        sharp = [frame.max_curvature <= 3.2]
        with unchecked():
            bent = em.equilibrium_set(frame, box, within=sharp, intervals=intervals)
            alone = em.find_equilibria(frame, {"t": 0.0, "P": 0.0}, within=sharp, seed=5)
        assert bent.audit.clean, bent.audit
        assert bent.audit.components == 14
        middle = bent.over(t=np.zeros(1), P=np.zeros(1))
        np.testing.assert_array_equal(np.sort(middle.index), np.sort(alone.index))
