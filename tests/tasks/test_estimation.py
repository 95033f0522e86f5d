"""State estimation: the spring against scans of its closed form, and the arch.

F/k = (1 − x_l/cos δ) sin δ; states are stable where x_l > cos³ δ.
"""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.manifold import equilibrium_set, part
from typecheck import unchecked


def force(delta, x):
    return (1 - x / np.cos(delta)) * np.sin(delta)


@pytest.fixture(scope="module")
def loaded_arch():
    """The arch over its load, its actuators known: (Θ, Δ) = (1, 0.1)."""
    arch = em.Rod()
    with unchecked():
        return equilibrium_set(
            arch,
            em.Box(q=(-1.0, 8.0)),
            fixed={"Theta": 1.0, "Delta": 0.1},
            within=[arch.max_curvature <= 25],
            intervals=(24,),
            checks=0,
        )


def test_branch_and_load_are_told_from_one_angle(spring_set):
    """C_s: δ = 0.62 at x_l = 0.80 carries F/k = 0.009908; dF/dδ and dF/dx give its error."""
    spring = spring_set.structure
    error = {spring.angle: 1e-3, "x_l": 2e-3}
    found = em.estimate_state(spring_set, {spring.angle: 0.62, "x_l": 0.80}, error)
    assert found.known
    assert found.state["F"] == pytest.approx(force(0.62, 0.80), abs=1e-10)
    h = 1e-6
    by_delta = (force(0.62 + h, 0.8) - force(0.62 - h, 0.8)) / (2 * h)
    by_x = -np.tan(0.62)
    wanted = np.hypot(by_delta * 1e-3, by_x * 2e-3)
    assert found.standard_errors["F"][0] == pytest.approx(wanted, rel=1e-6)
    assert found.standard_errors["x_l"][0] == pytest.approx(2e-3, rel=1e-6)
    assert found.margin[0] == pytest.approx(found.state.margin)


def test_both_branches_explain_their_parameters(spring_set):
    """Over (0.8, 0) lie δ = ±arccos 0.8, equally likely; the height y_B tells them apart."""
    error = {"x_l": 0.01, "F": 0.01}
    found = em.estimate_state(spring_set, {"x_l": 0.8, "F": 0.0}, error)
    assert found.status == "ambiguous"
    assert found.weight[:2] == pytest.approx([0.5, 0.5], abs=1e-4)
    assert np.sort(np.abs(found.states.z[:2, 0])) == pytest.approx(2 * [np.arccos(0.8)], abs=1e-9)
    assert found.next_measurement.descriptor.name == "shape_y(1)"
    assert found.next_measurement.separation == pytest.approx(1.2, abs=1e-9)
    assert "2 states explain" in found.why
    every = em.estimate_state(spring_set, {"x_l": 0.8, "F": 0.0}, error, unstable=True)
    assert np.sum(every.weight > 0.3) == 3


def test_the_suggested_measurement_resolves_the_ambiguity(spring_set):
    spring = spring_set.structure
    known, error = {"x_l": 0.8, "F": 0.0}, {"x_l": 0.01, "F": 0.01}
    could = {spring.angle: 0.1, spring.height: 0.01, spring.descriptor("energy"): 0.1}
    asked = em.estimate_state(spring_set, known, error, could_measure=could).next_measurement
    assert asked.descriptor == spring.height
    assert asked.separation == pytest.approx(120.0, rel=1e-9)
    told = em.estimate_state(
        spring_set, {**known, spring.height: 0.59}, {**error, spring.height: 0.01}
    )
    assert told.known
    assert told.state.z[0] > 0


def test_the_best_stable_fit_may_lie_at_the_edge_of_stability(spring_set):
    """δ = 0.1 ± 0.1 and x_l = 0.9 ± 0.01: the least χ² with x_l ≥ cos³ δ, by a scan."""
    spring = spring_set.structure
    error = {spring.angle: 0.1, "x_l": 0.01}
    found = em.estimate_state(spring_set, {spring.angle: 0.1, "x_l": 0.9}, error)
    delta = np.linspace(-0.6, 0.6, 200001)
    chi2 = ((delta - 0.1) / 0.1) ** 2 + ((np.cos(delta) ** 3 - 0.9) / 0.01) ** 2
    right = delta > 0
    assert found.chi2[0] == pytest.approx(chi2[right].min(), rel=1e-6)
    assert found.chi2[1] == pytest.approx(chi2[~right].min(), rel=1e-6)
    assert not found.inside[:2].any()
    likely = np.exp(-0.5 * (found.chi2 - found.chi2[0]))
    assert found.weight == pytest.approx(likely / likely.sum())


def test_errors_cover_the_truth(spring_set):
    """Of 30 noisy measurements of δ, y_B and x_l 95 % lie within 1.96 errors of the load."""
    spring, generator = spring_set.structure, np.random.default_rng(5)
    truth = {spring.angle: 0.62, spring.height: 0.8 * np.tan(0.62), "x_l": 0.8}
    error = {spring.angle: 4e-3, spring.height: 6e-3, "x_l": 5e-3}
    inside = 0
    with unchecked():
        for _ in range(30):
            seen = {what: generator.normal(truth[what], error[what]) for what in truth}
            found = em.estimate_state(spring_set, seen, error)
            off = found.state["F"] - force(0.62, 0.8)
            inside += abs(off) < 1.96 * found.standard_errors["F"][0]
    assert inside >= 24  # 28.5 expected, standard deviation 1.2


@pytest.fixture(scope="module")
def pushed_spring():
    """The spring under forces F ≥ 0 only: its side F = 0 is x = cos δ, or δ = 0."""
    with unchecked():
        return equilibrium_set(
            em.Spring(), em.Box(x_l=(0.3, 1.3), F=(0.0, 0.5)), intervals=(12, 12), checks=0
        )


def least_misfit_at_no_force(delta: float, x: float) -> float:
    """Least χ of (δ, x) with errors 0.01 on F = 0: x = cos δ with δ ≠ 0, or δ = 0 and x > 1."""
    angles = np.linspace(-1.2, 1.2, 240001)
    buckled = np.hypot(angles - delta, np.cos(angles) - x).min()
    straight = np.hypot(delta, min(x - 1.0, 0.0))
    return float(min(buckled, straight) / 0.01)


def test_best_fits_at_a_side_of_the_box_are_least_along_it(pushed_spring):
    """Of 80 noisy (δ, x) near F = 0 most fit best at F < 0: one candidate, the nearest on F = 0."""
    spring, generator = pushed_spring.structure, np.random.default_rng(0)
    outside = 0
    with unchecked():
        for _ in range(12):
            x = generator.uniform(0.5, 0.95)
            delta, seen_x = -np.arccos(x) + generator.normal(0, 0.01), x + generator.normal(0, 0.01)
            seen = {spring.angle: delta, "x_l": seen_x}
            found = em.estimate_state(pushed_spring, seen, dict.fromkeys(seen, 0.01))
            assert found.known
            assert len(found.states) == 1
            if force(delta, seen_x) >= 0.0:
                assert found.chi2[0] == pytest.approx(0.0, abs=1e-12)
                assert found.inside[0]
            else:
                outside += 1
                assert not found.inside[0]
                assert found.state["F"] == pytest.approx(0.0, abs=1e-12)
                least = least_misfit_at_no_force(delta, seen_x)
                assert np.sqrt(found.chi2[0]) == pytest.approx(least, abs=1e-4)
    assert outside >= 3


@pytest.fixture(scope="module")
def steered_arch():
    """The arch over Θ and q ≥ 0 at Δ = 0.05."""
    arch = em.Rod()
    with unchecked():
        return equilibrium_set(
            arch,
            em.Box(Theta=(0.5, 1.5), q=(0.0, 4.0)),
            fixed={"Delta": 0.05},
            within=[arch.max_curvature <= 20],
            intervals=(10, 10),
            checks=0,
        )


def estimates_of_the_arch(eset, places):
    """χ² of true states over places, drawn at random, and estimates from heights with errors."""
    arch, generator = eset.structure, np.random.default_rng(0)
    left, right = arch.height(1 / 3), arch.height(2 / 3)
    out = []
    for place in places(generator):
        here = eset.at(**place).stable
        state = here[int(generator.integers(len(here)))]
        seen = {each: each(state) + generator.normal(0, 1e-3) for each in (left, right)}
        truth = sum(((each(state) - value) / 1e-3) ** 2 for each, value in seen.items())
        out.append((truth, em.estimate_state(eset, seen, dict.fromkeys(seen, 1e-3))))
    return out


@pytest.mark.slow
def test_a_state_beside_the_limit_of_an_actuator_has_one_candidate(steered_arch):
    """29 of 80 were ambiguous, with up to four candidates on one side."""

    def places(draw):
        return [
            {"Theta": 1.5 - abs(draw.normal()) * 0.02, "q": draw.uniform(0.2, 3)} for _ in range(40)
        ]

    with unchecked():
        estimates = estimates_of_the_arch(steered_arch, places)
    for truth, found in estimates:
        assert found.known
        assert len(found.states) == 1
        assert found.chi2[0] <= truth


@pytest.mark.slow
def test_candidates_near_no_load_are_minima_of_their_own(steered_arch):
    """30 of 100 were ambiguous, with up to six candidates; 16 of them on a fine grid, too.

    Candidates are inside, or exactly at q = 0 or a limit of Θ, and clearly apart.
    """

    def places(draw):
        return [
            {"Theta": draw.uniform(0.6, 1.4), "q": abs(draw.normal() * 0.05)} for _ in range(40)
        ]

    with unchecked():
        estimates = estimates_of_the_arch(steered_arch, places)
    for truth, found in estimates:
        assert found.chi2[0] <= truth
        theta, load = found.states["Theta"], found.states["q"]
        side = np.minimum(np.abs(load), np.abs(np.abs(theta - 1.0) - 0.5))
        assert (found.inside | (side < 1e-9)).all()
        assert np.hypot(np.diff(theta), np.diff(load)).min(initial=1.0) > 0.05
        assert len(found.states) <= 3


def test_nothing_explains_what_contradicts_itself(spring_set):
    spring = spring_set.structure
    seen = {spring.angle: 0.62, spring.height: 0.2, "x_l": 0.8}
    found = em.estimate_state(spring_set, seen, dict.fromkeys(seen, 1e-3))
    assert found.status == "refused"
    assert "no state of the set explains" in found.why


def test_heights_tell_the_load_of_the_arch(loaded_arch):
    """A state over (1, 0.1) at q = 2.5 or 1.7, upright or inverted, is found by two heights."""
    arch = loaded_arch.structure
    left, right = arch.height(1 / 3), arch.height(2 / 3)
    for q in (1.7, 2.5):
        for state in loaded_arch.at(q=q).stable:
            seen = {left: left(state) + 2e-4, right: right(state) - 2e-4}
            found = em.estimate_state(loaded_arch, seen, {left: 1e-3, right: 1e-3})
            assert found.known
            assert found.state["q"] == pytest.approx(q, abs=4 * found.standard_errors["q"][0])
            assert np.sign(arch.height(0.5)(found.state)) == np.sign(arch.height(0.5)(state))


@pytest.mark.parametrize(
    ("measured", "errors", "options", "words"),
    [
        ({"F": 0.0}, {"F": 0.1}, {}, "at least 2 values"),
        ({"F": 0.0, "x_l": 0.8}, {"F": 0.1}, {}, "one for every value; got none for x_l"),
        ({"F": 0.0, "x_l": 0.8}, {"F": 0.1, "x_l": -1.0}, {}, "must be positive"),
        ({"F": np.nan, "x_l": 0.8}, {"F": 0.1, "x_l": 0.1}, {}, "finite numbers"),
        ({"F": 0.0, "y": 0.8}, {"F": 0.1, "y": 0.1}, {}, "must name parameters"),
        ({"F": 0.0, "x_l": 0.8}, {"F": 0.1, "x_l": 0.1}, {"confidence": 1.0}, "between 0.5 and 1"),
    ],
)
def test_bad_measurements_are_refused(spring_set, measured, errors, options, words):
    with unchecked(), pytest.raises(InputError, match=words):
        em.estimate_state(spring_set, measured, errors, **options)


def test_a_set_without_stable_states_is_refused(spring_set):
    rest = part(spring_set, spring_set.cell_index == 1)
    with pytest.raises(InputError, match="must have stable cells"):
        em.estimate_state(rest, {"F": 0.0, "x_l": 0.8}, {"F": 0.1, "x_l": 0.1})
