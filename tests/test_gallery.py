"""The gallery of rods: study files and examples, and the closed forms and values that they name."""

from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import numpy as np
import pytest
from matplotlib.axes import Axes

import equimorph as em
from equimorph.study.prepare import prepare
from equimorph.study.problem import parse_study
from typecheck import unchecked

EXAMPLES = Path(__file__).parents[1] / "examples"
NAMES = ("arch", "strip", "arm", "beam", "deep_arch", "stack", "truss", "column", "least_torque")


def study(name):
    file = EXAMPLES / f"{name}.toml"
    return prepare(parse_study(file.read_text(encoding="utf-8"), file.name))


def example(name):
    spec = spec_from_file_location(f"example_{name}", EXAMPLES / f"{name}.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_the_strip_snaps_when_one_end_turns_alone():
    """α/√(1 − ν) → 1.7818 as ν → 1 [Gomez2017]_; 1 % at ν = 0.95."""
    strip = study("strip").structure
    bent = em.lift(strip.natural_state(Theta=0.1), {"Theta": 0.0}).end.state
    end = em.lift(bent, {"Theta": -0.3, "Delta": -0.3}).end
    assert end.kind == "fold"
    assert -2 * end.state["Theta"] == pytest.approx(1.7818 * np.sqrt(0.05), rel=0.01)


def test_the_shallow_m_sways_when_its_clamps_reach_twice_the_root_of_the_shortening():
    """y' = −α sin(kx)/sin(k/2), tan(k/2) = k/2: the shortening ½∫y'² is α²/4; error O(1 − ν)."""
    limit = em.limit_load(example("m_shape").hanging(em.Rod(), 0.999), "Theta")
    assert limit.kind == "branch point"
    assert limit.value == pytest.approx(2.0 * np.sqrt(1e-3), rel=1.1e-4)


def test_the_straight_arm_buckles_under_pi_squared_over_four():
    """A cantilever's Euler load; in the units of the file. 1e-9: located to round-off."""
    arm = study("arm").structure
    end = em.lift(arm.natural_state(theta_A=np.pi / 2), {"P": 4.0}).end
    assert end.kind == "branch point"
    assert end.state["P"] == pytest.approx(np.pi**2 / 4, rel=1e-9)


def test_the_beam_buckles_where_its_support_has_taken_the_strain_of_eulers_load():
    """ν = 1 − e with e (1 − e) = 4π²/2500: force and moment balance of a shortened straight rod."""
    beam = study("beam").structure
    end = em.lift(beam.natural_state(nu=1.0), {"nu": 0.97}).end
    assert end.kind == "branch point"
    assert end.state["nu"] == pytest.approx(0.5 + np.sqrt(0.25 - 4 * np.pi**2 / 2500), rel=1e-10)


def test_the_deep_arch_snaps_at_the_printed_load_and_carries_more_when_turned():
    """8.97309 [DaDeppoSchmidt1975]_, six digits."""
    arch = study("deep_arch").structure
    built = arch.natural_state(theta_A=np.deg2rad(107.5))
    assert em.limit_load(built, "P").value == pytest.approx(8.97309, abs=6e-6)
    turned = em.lift(built, {"theta_A": 2.1}).end.state
    assert em.limit_load(turned, "P").value > 10.8


def test_the_stack_has_nine_equilibria_four_of_them_stable():
    """Three heights of each element."""
    truss = study("stack").structure
    with unchecked():
        found = em.find_equilibria(truss, {"a": 0.001, "F": 0.0})
    np.testing.assert_array_equal(np.sort(found.index), [0, 0, 0, 0, 1, 1, 1, 1, 2])


def test_a_truss_that_snaps_back_has_the_limit_points_of_one_that_snaps_through():
    """[Mises1923]_, l³ = L² l₀; a bar in series adds F/k to the displacement. 1e-9: round-off."""
    module = example("limit_points")
    with unchecked():
        found = module.main()
    length = np.cbrt(np.hypot(1.0, module.RISE))
    y = np.sqrt(length**2 - 1.0)
    load = 2.0 * y * (1.0 / length - length**-3)
    for joint, softness in (("B", 0.0), ("D", 1.0 / module.STIFFNESS)):
        folds = module.limits(found[joint])
        move = folds[0].structure.displacement(joint, "y")
        for fold, side in zip(folds, (1.0, -1.0), strict=True):
            assert fold["F"] == pytest.approx(side * load, rel=1e-9)
            down = module.RISE - side * y + side * softness * load
            assert -move(fold) == pytest.approx(down, rel=1e-6)


def test_the_column_buckles_where_its_example_says():
    """P = (3 − √5)/2 k. 1e-9: located to round-off."""
    column = example("column").column()
    assert column.signature == study("column").structure.signature
    assert em.limit_load(column.natural_state(), "P").value == pytest.approx(
        (3.0 - np.sqrt(5.0)) / 2.0, rel=1e-9
    )


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_the_example_finds_its_set_and_its_way(name):
    """The audit is clean, the route arrives, and file and example speak of one rod."""
    module = example(name)
    with unchecked():
        result = module.main()
        assert isinstance(module.figure(result), Axes)
    assert result.eset.audit.clean
    assert result.route.status == "arrived"
    assert result.route.path.states.index.max() == 0
    problem = study(name)
    assert problem.structure.signature == result.eset.structure.signature
