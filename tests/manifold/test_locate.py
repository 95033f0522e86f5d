"""Which state was measured: exact values give it back, ambiguous ones say so."""

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.manifold import equilibrium_set, locate
from equimorph.model import Box
from equimorph.structures import Rod, Spring
from sets import arch_set
from typecheck import unchecked


def force(delta, x):
    return (1 - x / np.cos(delta)) * np.sin(delta)


@pytest.mark.parametrize("delta", [0.62, -0.05, -0.55])
def test_exact_values_of_two_descriptors_give_the_state_back(spring_set, delta):
    """δ and the height x_l tan δ determine x_l, and so F; on stable and unstable parts."""
    spring, x = spring_set.structure, 0.83
    found = locate(spring_set, {spring.angle: delta, spring.height: x * np.tan(delta)})
    assert found.state.z[0] == pytest.approx(delta, abs=1e-9)
    assert found.state["F"] == pytest.approx(force(delta, x), abs=1e-9)
    assert found.best.misfit < 1e-10
    assert found.best.inside
    index = int(x < np.cos(delta) ** 3)
    assert spring_set.strata[found.best.stratum].index == found.state.index == index


def test_parameters_alone_leave_the_sheet_open(spring_set):
    """Three states over (0.8, 0): the best and the next fit equally well."""
    found = locate(spring_set, {"x_l": 0.8, "F": 0.0})
    assert found.gap == pytest.approx(0.0, abs=1e-9)
    assert found.runner_up is not None
    assert abs(found.best.state.z[0] - found.runner_up.state.z[0]) > 0.1
    angle = spring_set.structure.angle
    told = locate(spring_set, {"x_l": 0.8, "F": 0.0, angle: -0.6})
    # arccos 0.8 = 0.6435: the other states are half of the range away
    assert told.state.z[0] == pytest.approx(-np.arccos(0.8), abs=0.05)
    assert told.gap > 0.1


def test_noisy_values_are_fitted_in_their_errors(spring_set):
    """Least squares by a scan of the closed form, at 1e-4 of δ and x_l."""
    spring = spring_set.structure
    measured = {spring.angle: 0.60, "x_l": 0.82, "F": 0.03}
    errors = {spring.angle: 0.02, "x_l": 0.01, "F": 0.005}
    found = locate(spring_set, measured, errors=errors)
    delta, x = np.meshgrid(np.linspace(0.5, 0.7, 801), np.linspace(0.77, 0.87, 801))
    left = [(delta - 0.60) / 0.02, (x - 0.82) / 0.01, (force(delta, x) - 0.03) / 0.005]
    misfit = np.sqrt(np.sum(np.square(left), axis=0))
    best = np.unravel_index(misfit.argmin(), misfit.shape)
    assert found.best.misfit == pytest.approx(misfit[best], rel=1e-5)
    assert found.state["x_l"] == pytest.approx(x[best], abs=5e-4)
    assert found.state.z[0] == pytest.approx(delta[best], abs=5e-4)


def test_a_shape_tells_the_state(spring_set):
    states = spring_set.at(x_l=0.8, F=0.02)
    for state in states:
        found = locate(spring_set, state.shape())
        assert found.state.z[0] == pytest.approx(state.z[0], abs=1e-9)
    s = np.array([0.25, 0.5, 1.0])
    found = locate(spring_set, states[0].shape(s), s=s)
    assert found.state.z[0] == pytest.approx(states[0].z[0], abs=1e-9)
    assert "next best" in repr(found)


def test_a_measurement_beyond_the_box_is_found_at_its_side(spring_set):
    """x_l = 1.5 while the box ends at 1.3."""
    found = locate(spring_set, {"x_l": 1.5, "F": 0.0})
    assert found.state["x_l"] == pytest.approx(1.3, abs=1e-3)
    assert not found.best.inside


@pytest.mark.parametrize(
    ("box", "fixed", "intervals"),
    [
        (Box(F=(-0.4, 0.4)), {"x_l": 0.7}, (9,)),
        (Box(x_l=(0.5, 1.2), F=(-0.3, 0.3), k=(0.5, 2)), {}, (4, 5, 3)),
    ],
    ids=["d=1", "d=3"],
)
def test_states_are_located_over_one_and_three_parameters(box, fixed, intervals):
    spring = Spring()
    with unchecked():
        eset = equilibrium_set(spring, box, fixed=fixed, intervals=intervals, checks=0)
    middle = dict(zip(box.names, (0.45 * box.lower + 0.55 * box.upper).tolist(), strict=True))
    for state in eset.at(**middle):
        found = locate(eset, {spring.angle: state.z[0], **middle})
        assert found.state.z[0] == pytest.approx(state.z[0], abs=1e-8)
        assert found.best.misfit < 1e-8


def test_wrong_measurements_are_refused(spring_set):
    spring = spring_set.structure
    with pytest.raises(InputError, match="at least 2 values, one for each free parameter; got 1"):
        locate(spring_set, {spring.angle: 0.3})
    with pytest.raises(InputError, match=r"name parameters \(x_l, F, k\).*got 'G'"):
        locate(spring_set, {"G": 0.3, "F": 0.0})
    with pytest.raises(InputError, match="got angle = nan"):
        locate(spring_set, {spring.angle: np.nan, "F": 0.0})
    with pytest.raises(InputError, match=r"free parameters.*got 'k', which is fixed"):
        locate(spring_set, {"x_l": 0.8, "k": 2.0})
    with pytest.raises(InputError, match=r"must describe the structure .*; got height\(0.5\)"):
        locate(spring_set, {Rod().height(0.5): 0.1, "F": 0.0})
    with (
        unchecked(),
        pytest.raises(InputError, match="got F = 'none'"),
    ):
        locate(spring_set, {spring.angle: 0.1, "F": "none"})
    with pytest.raises(InputError, match=r"`errors` must be positive.*got F = 0"):
        locate(spring_set, {spring.angle: 0.1, "F": 0.0}, errors={"F": 0.0})
    with pytest.raises(InputError, match=r"shape \(5, 2\)"):
        locate(spring_set, np.zeros((5, 2)))


@pytest.mark.slow
def test_states_of_the_arch_are_located_by_descriptors_and_shapes():
    """Random vertices of all indices from two heights and max |κ|, and from 21 points."""
    eset = arch_set((24, 41))
    arch = eset.structure
    with unchecked():
        descriptors = (arch.height(1 / 3), arch.height(2 / 3), arch.max_curvature)
        s = np.linspace(0, 1, 21)
        for vertex in np.random.default_rng(2).integers(len(eset.points), size=12):
            state = eset.points[int(vertex)]
            for found in (
                locate(eset, {each: each(state) for each in descriptors}),
                locate(eset, state.shape(s), s=s),
            ):
                np.testing.assert_allclose(found.state.z, state.z, rtol=0, atol=1e-5)
                assert found.best.misfit < 1e-8
                assert found.gap >= 0.0
