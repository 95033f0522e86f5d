"""Fits to synthetic measurements whose truth is known; the spring's angles are in closed form."""

import numpy as np
import pytest

from equimorph.equilibria import lift
from equimorph.errors import InputError
from equimorph.structures import Bar, Rod, Spring, States, Truss
from equimorph.tasks.calibration.calibrate import Branch, calibrate
from equimorph.tasks.calibration.measurements import MeasuredShape, MeasuredValues
from equimorph.tasks.calibration.unknowns import unknowns
from typecheck import unchecked

K, OFFSET = 1.3, 0.02
LENGTHS, FORCES = np.meshgrid([1.15, 1.3, 1.5], [-0.2, 0.1, 0.3], indexing="ij")


@pytest.fixture
def quick():
    """Without checks of shapes, which the tests of few small states make."""
    with unchecked():
        yield


def _lifted(state, **goals) -> States:
    """One state for each of some parameter values, lifted from the same one."""
    count = len(next(iter(goals.values())))
    start = States(state.structure, np.tile(state.z, (count, 1)), np.tile(state.p, (count, 1)))
    lifts = lift(start, dict(goals))
    assert (lifts.kind == "arrived").all()
    return lifts.states


@pytest.fixture(scope="module")
def nominal() -> States:
    """The spring with k = 1 at nine settings."""
    rest = Spring().natural_state(x_l=1.2)
    return _lifted(rest, x_l=LENGTHS.ravel(), F=FORCES.ravel())


@pytest.fixture(scope="module")
def angles() -> np.ndarray:
    """Angles of a spring with k = K whose actuator stands OFFSET further out than it should."""
    rest = Spring(K).natural_state(x_l=1.2)
    states = _lifted(rest, x_l=LENGTHS.ravel() + OFFSET, F=FORCES.ravel())
    force = K * (1.0 - states["x_l"] / np.cos(states.z[:, 0])) * np.sin(states.z[:, 0])
    np.testing.assert_allclose(force, FORCES.ravel(), atol=1e-12)
    return states.z[:, 0]


WANTED = {"k": "value", "x_l": "offset"}


def _fit(nominal: States, angles: np.ndarray, sigma: float | None = None):
    angle = nominal.structure.descriptor("angle")
    return calibrate(nominal, WANTED, [MeasuredValues(angle, angles, sigma)])


def test_exact_measurements_give_the_truth_back(nominal, angles):
    """Tolerance: round-off of the states, times how strongly the unknowns depend on them."""
    fit = _fit(nominal, angles)
    assert fit.fitted
    assert fit.names == ("k", "offset of x_l")
    assert fit["k"] == pytest.approx(K, abs=1e-9)
    assert fit["offset of x_l"] == pytest.approx(OFFSET, abs=1e-9)
    np.testing.assert_allclose(fit.states.z[:, 0], angles, atol=1e-10)


def test_the_jacobian_is_that_of_the_equilibria(nominal):
    """Against closed form: dδ = −(∂F/∂k dk + ∂F/∂x_l dx_l)/(∂F/∂δ) of F = k (1 − x_l/cos δ) sin δ.

    Tolerance: differences of fourth order.
    """
    free = unknowns(nominal, WANTED)
    measured = MeasuredValues(nominal.structure.descriptor("angle"), np.zeros(9))
    ones = np.ones((9, 1))
    branch = Branch(free, [measured], np.zeros((9, 1)), ones, nominal.z, nominal.p, free.start)
    branch.residuals(free.start)
    found = branch.jacobian(free.start)
    delta, x_l = nominal.z[:, 0], nominal["x_l"]
    slope = np.cos(delta) - x_l / np.cos(delta) ** 2
    along_k = (1.0 - x_l / np.cos(delta)) * np.sin(delta)
    exact = np.stack([-along_k / slope, np.tan(delta) / slope], axis=1)
    np.testing.assert_allclose(found, exact, rtol=1e-9, atol=1e-11)


@pytest.mark.slow
@pytest.mark.usefixtures("quick")
def test_the_covariance_is_that_of_repeated_fits(nominal, angles):
    """Normalised errors of k unknowns have the mean square k: variance 2 k over the trials.

    Tolerance: four standard deviations, and 40 % on the variances (120 trials: 13 % each).
    """
    generator, sigma, trials = np.random.default_rng(1), 1e-3, 120
    errors, squares = [], []
    for _ in range(trials):
        fit = _fit(nominal, angles + sigma * generator.standard_normal(9), sigma)
        error = fit.values - [K, OFFSET]
        errors.append(error)
        squares.append([error @ np.linalg.solve(fit.covariance, error), fit.chi_squared])
    mean = np.mean(squares, axis=0)
    assert mean[0] == pytest.approx(2.0, abs=4.0 * np.sqrt(2.0 * 2.0 / trials))
    assert mean[1] == pytest.approx(7.0, abs=4.0 * np.sqrt(2.0 * 7.0 / trials))
    np.testing.assert_allclose(np.cov(np.transpose(errors)), fit.covariance, rtol=0.4, atol=0)


@pytest.mark.usefixtures("quick")
def test_without_deviations_the_scatter_gives_the_covariance(nominal, angles):
    """(JᵀJ)⁻¹ Σ r²/(m − k): the covariance with σ times χ²/(m − k)."""
    noisy = angles + 1e-3 * np.random.default_rng(2).standard_normal(9)
    with_sigma, without = _fit(nominal, noisy, 1e-3), _fit(nominal, noisy)
    expected = with_sigma.covariance * with_sigma.chi_squared / with_sigma.freedom
    np.testing.assert_allclose(without.covariance, expected, rtol=1e-6)


def test_missing_values_do_not_count(nominal, angles):
    angles = angles.copy()
    angles[[1, 5]] = np.nan
    fit = _fit(nominal, angles)
    assert fit["k"] == pytest.approx(K, abs=1e-9)
    assert fit.freedom == 5


@pytest.mark.usefixtures("quick")
def test_stiffness_and_offsets_of_an_arch_from_its_shape():
    """Of a dimensionless rod the stiffness is the inverse of the gain of its load."""
    arch, places = Rod(), np.linspace(0.1, 0.9, 9)
    rest = arch.natural_state(Theta=1.0)
    Theta, Delta, q = (
        np.array([1.0, 1.2, 0.9]),
        np.array([0.1, -0.3, 0.4]),
        np.array([1.0, 2.0, 1.5]),
    )
    truth = _lifted(rest, Theta=Theta + 0.03, Delta=Delta - 0.02, q=1.2 * q)
    start = _lifted(rest, Theta=Theta, Delta=Delta, q=q)
    fit = calibrate(
        start,
        {"q": "gain", "Theta": "offset", "Delta": "offset"},
        [
            MeasuredShape(truth.shape(places), places, sigma=1e-3),
            MeasuredValues(arch.max_curvature, arch.max_curvature(truth), sigma=0.1),
        ],
    )
    assert fit.fitted
    np.testing.assert_allclose(fit.values, [1.2, 0.03, -0.02], atol=1e-8)
    assert (fit.states.index == 0).all()


@pytest.mark.usefixtures("quick")
def test_a_fit_stays_on_its_branch(angles):
    """The arch upright and inverted: both give the load's gain, each from its own side."""
    arch = Rod()
    rest = arch.natural_state(Theta=1.0)
    tops = _lifted(rest, q=np.array([1.0, 2.0]))
    rise = arch.height(0.5)
    fit = calibrate(tops, {"q": "gain"}, [MeasuredValues(rise, rise(tops) - 1e-3)])
    assert fit.fitted
    assert fit["gain of q"] > 1.0
    assert (rise(fit.states) > 0.2).all()


@pytest.mark.usefixtures("quick")
def test_a_truss_tells_how_wrong_its_actuators_are():
    bars = [Bar(("A", "B")), Bar(("B", "C"))]
    joints = {"A": (-1.0, 0.0), "B": (0.0, 0.3), "C": (1.0, 0.0)}
    truss = Truss(
        joints, bars, {"A": "xy", "C": "xy"},
        loads={"F": {"B": (0.0, -1.0)}}, actuators={"a": {"A-B": 1.0}, "c": {"B-C": 1.0}},
    )  # fmt: skip
    rest = truss.natural_state()
    loads = np.array([0.001, 0.003])
    truth = _lifted(rest, F=loads, a=np.array([0.004, 0.004]), c=np.array([-0.002, -0.002]))
    moves = [truss.descriptor(f"displacement(B,{axis})") for axis in "xy"]
    start = _lifted(rest, F=loads)
    measured = [MeasuredValues(each, each(truth)) for each in moves]
    fit = calibrate(start, {"a": "value", "c": "value"}, measured)
    np.testing.assert_allclose(fit.values, [0.004, -0.002], atol=1e-9)


@pytest.mark.usefixtures("quick")
def test_what_the_measurements_do_not_tell_is_named(nominal, angles):
    """Angles depend on F/k only."""
    angle = nominal.structure.descriptor("angle")
    fit = calibrate(nominal, {"k": "value", "F": "gain"}, [MeasuredValues(angle, angles)])
    assert fit.status == "undetermined"
    assert "do not depend on" in fit.why
    assert "gain of F" in fit.why
    assert np.isnan(fit.covariance).all()


@pytest.mark.usefixtures("quick")
def test_a_fit_beyond_a_fold_is_refused():
    """With x_l = 0.8 the spring snaps at F/k = (1 − 0.8^⅔)^{3/2} = 0.0509 and δ = 0.3801."""
    spring = Spring()
    rest = spring.natural_state(x_l=0.8)
    start = _lifted(rest, F=np.array([0.02]))
    assert start.index[0] == 0
    beyond = MeasuredValues(spring.descriptor("angle"), [0.0])
    fit = calibrate(start, {"F": "gain"}, [beyond])
    assert fit.status == "branch ends"
    assert "fold" in fit.why
    assert fit.states.index[0] == 0


@pytest.mark.usefixtures("quick")
def test_a_parameter_keeps_its_meaning(nominal):
    """Stiffer than infinitely stiff: k runs to 0 or away for angles of the wrong sign."""
    angle = nominal.structure.descriptor("angle")
    wrong = calibrate(nominal, {"k": "value"}, [MeasuredValues(angle, 8.0 * nominal.z[:, 0])])
    assert wrong.states["k"].min() > 0.0


@pytest.mark.parametrize(
    ("unknown", "values", "sigma", "message"),
    [
        ({}, np.zeros(9), None, "`unknown` must name at least one parameter"),
        ({"stiffness": "value"}, np.zeros(9), None, "`stiffness` must be a parameter"),
        ({"k": "factor"}, np.zeros(9), None, "`unknown` must be one of value, offset, gain, data"),
        ({"x_l": "value"}, np.zeros(9), None, "`start` must have one value of x_l"),
        (
            {("k", "F"): "gain", "k": "value"},
            np.zeros(9),
            None,
            "must name a parameter once; got k",
        ),
        ({"k": "value"}, np.zeros(8), None, "`values of angle` must have the shape"),
        ({"k": "value"}, np.full(9, np.inf), None, "must be finite numbers, or nan"),
        ({"k": "value"}, np.full(9, np.nan), None, "must hold at least as many numbers as"),
        ({"k": "value"}, np.zeros(9), -1.0, "`sigma` must be positive and finite"),
        ({"k": "value"}, np.zeros(9), np.ones(4), "`sigma` must be one number, or have one per"),
    ],
)
@pytest.mark.usefixtures("quick")
def test_wrong_input_is_named(unknown, values, sigma, message, nominal):
    measured = MeasuredValues(nominal.structure.descriptor("angle"), values, sigma)
    with pytest.raises(InputError) as error:
        calibrate(nominal, unknown, [measured])
    assert message in str(error.value)


def test_deviations_are_given_for_all_or_none(nominal):
    angle = nominal.structure.descriptor("angle")
    some = [MeasuredValues(angle, np.zeros(9), 1.0), MeasuredValues(angle, np.zeros(9))]
    with pytest.raises(InputError, match="must be given for all measurements or for none"):
        calibrate(nominal, {"k": "value"}, some)
    with pytest.raises(InputError, match="at least one measurement"):
        calibrate(nominal, {"k": "value"}, [])
