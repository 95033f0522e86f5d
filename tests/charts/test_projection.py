"""Projection and descriptor coordinates: the spring in closed form, surfaces, the arch."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

import equimorph as em
from equimorph.charts.domain import single_valued
from equimorph.charts.regions import count_regions
from equimorph.equilibria import settle
from equimorph.errors import InputError
from equimorph.manifold import part
from oracles.charted import lifted, spring_fold
from oracles.polynomial import fold_form
from oracles.surfaces import cusp, sphere, swallowtail, three_sheets
from sets import arch_set
from typecheck import unchecked


@pytest.fixture(scope="module")
def stable_spring(spring_set):
    return em.Projection(part(spring_set, spring_set.cell_index == 0))


@pytest.fixture(scope="module")
def spring_chart(spring_set):
    return em.DescriptorChart(spring_set, ["angle", "x_l"])


@pytest.fixture(scope="module")
def cusp_chart():
    return em.Projection(lifted(cusp(), em.Box(a=(-2, 1), b=(-3, 3)), (9, 10)))


def test_the_stable_spring_lies_over_itself_inside_its_folds(stable_spring):
    """Area between the fold curves; chords lose about the square of the cells."""
    x = np.linspace(0.3, 1.0, 10_001)
    area = 2.0 * np.trapezoid(spring_fold(x), x)
    assert not stable_spring.single_valued
    (overlap,) = stable_spring.overlaps
    assert (overlap.kind, overlap.sheets) == ("self-overlap", (0,))
    assert overlap.domain.size == pytest.approx(area, rel=5e-3)
    assert stable_spring.domain.size == pytest.approx(1.0 - area, rel=3e-3)
    assert {edge.kind for edge in overlap.domain.edges} >= {"box", "fold"}


def test_states_of_the_stable_spring_are_named_by_where_they_lie(stable_spring):
    generator = np.random.default_rng(5)
    at = generator.uniform((0.25, -0.5), (1.35, 0.5), (2000, 2))
    with unchecked():
        found = stable_spring.state(at)
    inner = np.abs(at[:, 1]) < spring_fold(at[:, 0])
    wanted = np.where(inner, "not single-valued", "inside")
    wanted[(at[:, 0] < 0.3) | (at[:, 0] > 1.3)] = "beyond the box"
    assert np.array_equal(found.status, wanted)
    own = found.states[found.inside]
    force = (1.0 - own["x_l"] / np.cos(own.z[:, 0])) * np.sin(own.z[:, 0])
    np.testing.assert_allclose(force, at[found.inside, 1], rtol=0, atol=1e-12)
    assert (own.index == 0).all()


def test_the_unstable_spring_is_single_valued(spring_set):
    chart = em.Projection(part(spring_set, spring_set.cell_index == 1))
    assert chart.single_valued
    found = chart.state(np.array([[0.5, 0.0], [0.9, 0.2]]))
    assert found.status.tolist() == ["inside", "gap"]
    assert found.states[0].z[0] == pytest.approx(0.0, abs=1e-12)
    assert {edge.kind for edge in chart.domain.edges} == {"fold", "box"}


@given(st.floats(-1.2, 1.2), st.floats(0.31, 1.29))
def test_angle_and_length_are_coordinates_of_the_spring(spring_chart, delta, x):
    """F = (1 − x_l/cos δ) sin δ is a graph over (δ, x_l): one chart for all of it, folds too."""
    chart = spring_chart
    force = (1.0 - x / np.cos(delta)) * np.sin(delta)
    with unchecked():
        found = chart.state(np.array([[delta, x]]))
    if abs(force) < 0.5:
        assert found.status.tolist() == ["inside"]
        assert found.states["F"][0] == pytest.approx(force, abs=1e-10)
        assert chart.coords(found.states)[0] == pytest.approx([delta, x], abs=1e-10)
        # ∂F/∂δ and ∂F/∂x_l at fixed other coordinate
        slopes = [np.cos(delta) - x / np.cos(delta) ** 2, -np.tan(delta)]
        jacobian = chart.jacobian(found.states)[0]
        assert jacobian[1] == pytest.approx(slopes, abs=1e-8, rel=1e-8)
        assert jacobian[0] == pytest.approx([0.0, 1.0], abs=1e-9)
    elif abs(force) > 0.5 + 1e-9:
        assert found.status.tolist() == ["beyond the box"]


def test_descriptor_chart_of_the_spring_is_single_valued(spring_chart):
    chart = spring_chart
    assert chart.single_valued
    assert chart.singular.pieces == ()
    assert {edge.kind for edge in chart.domain.edges} == {"box"}


def test_height_and_width_fail_on_a_great_circle_of_the_sphere():
    """(x, b) on x² + a² + b² = 1: the Jacobian vanishes at a = 0, two states elsewhere."""
    ball = lifted(sphere(), em.Box(a=(-1.3, 1.2), b=(-1.5, 1.5)), (7, 8))
    chart = em.DescriptorChart(ball, ["0", "b"])
    assert [overlap.kind for overlap in chart.overlaps] == ["fold"]
    assert chart.overlaps[0].domain.size == pytest.approx(np.pi, rel=0.1)
    with unchecked():
        level = chart.singular
    assert np.abs(level.states["a"]).max() < 1e-9
    assert chart.state(np.array([[0.3, 0.2]])).status.tolist() == ["not single-valued"]


@given(st.floats(-1.9, 0.95), st.floats(-2.9, 2.9))
def test_projection_of_the_cusp_is_its_inverse(cusp_chart, a, b):
    """x³ + ax + b: one state outside the folds 4a³ + 27b² = 0."""
    chart = cusp_chart
    with unchecked():
        found = chart.state(np.array([[a, b]]))
    discriminant = 4.0 * a**3 + 27.0 * b**2
    if discriminant > 1e-6:
        assert found.status.tolist() == ["inside"]
        assert chart.coords(found.states)[0] == pytest.approx([a, b], abs=1e-10)
        x = found.states.z[0, 0]
        assert x**3 + a * x + b == pytest.approx(0.0, abs=1e-10)
        assert chart.contains(found.states).all()
    elif discriminant < -1e-6:
        assert found.status.tolist() == ["not single-valued"]


def test_sheets_that_never_meet_are_told_from_folds():
    eset = lifted(three_sheets(), em.Box(a=(-3, 3), b=(-3, 3)), (4, 4))
    chart = em.Projection(eset)
    assert [overlap.kind for overlap in chart.overlaps] == ["sheets"] * 3
    assert [overlap.domain.size for overlap in chart.overlaps] == pytest.approx([36.0] * 3)
    assert chart.domain.loops == ()
    assert chart.domain.size == 0.0


def test_projection_over_one_parameter():
    """x² = a: none for a < 0, two for a > 0; its stable half is single-valued."""
    eset = lifted(fold_form(), em.Box(a=(-1, 1)), (7,))
    whole, half = em.Projection(eset), em.Projection(part(eset, eset.cell_index == 0))
    at = np.array([[-0.5], [0.25], [1.5]])
    assert whole.state(at).status.tolist() == ["gap", "not single-valued", "beyond the box"]
    found = half.state(at)
    assert found.status.tolist() == ["gap", "inside", "beyond the box"]
    assert abs(found.states.z[1, 0]) == pytest.approx(0.5, abs=1e-12)
    assert half.single_valued
    assert not whole.single_valued
    assert half.domain.size == pytest.approx(1.0, abs=1e-9)
    assert half.domain.contains(at).tolist() == [False, True, False]
    assert sorted(edge.kind for edge in half.domain.edges) == ["box", "fold"]
    along = em.DescriptorChart(eset, ["0"])
    assert along.single_valued
    assert along.state(np.array([[-0.3]])).states["a"][0] == pytest.approx(0.09, abs=1e-12)


def test_a_chart_that_folds_in_less_than_a_cell_is_not_single_valued():
    """(x + 0.97)² folds at x = −0.97, between the end of the set at x = −1 and its neighbour."""
    eset = lifted(fold_form(), em.Box(a=(-1, 1)), (7,))
    near_the_end = em.Descriptor("bent", "1", lambda z, p: (z[:, 0] + 0.97) ** 2)
    chart = em.DescriptorChart(eset, [near_the_end])
    assert single_valued(chart.cells)  # no cell is seen to lie over another
    np.testing.assert_allclose(chart.singular.states.z[:, 0], [-0.97], atol=1e-9)
    assert not chart.single_valued


@pytest.mark.slow
def test_projection_over_three_parameters():
    """x⁴ + ax² + bx + c is a graph c(x, a, b): (x, a, b) are coordinates, (a, b, c) are not."""
    box = em.Box(a=(-1.5, 0.5), b=(-1, 1), c=(-1, 1))
    x, a, b = 0.3, -0.7, 0.2
    with unchecked():
        eset = lifted(swallowtail(), box, (3, 3, 3))
        chart = em.DescriptorChart(eset, ["0", "a", "b"])
        found = chart.state(np.array([[x, a, b]]))
        contained = chart.contains(found.states)
        whole = em.Projection(eset)
        single_valued, size = whole.single_valued, whole.domain.size
    assert found.states["c"][0] == pytest.approx(-(x**4 + a * x**2 + b * x), abs=1e-10)
    assert contained.all()
    # a quartic has an even number of roots
    assert not single_valued
    assert size < 1e-9


def test_area_of_bistability_of_the_arch_is_that_of_the_set(arch_set):
    stable = arch_set.cells[arch_set.cell_index == 0]
    areas = count_regions(arch_set.coordinates, stable).areas()
    area = sum(areas[count] for count in areas if count >= 2)
    (overlap,) = em.Projection(part(arch_set, arch_set.cell_index == 0)).overlaps
    assert overlap.kind == "self-overlap"
    assert overlap.domain.size == pytest.approx(area, rel=1e-3)


def test_projection_of_the_stable_arch_agrees_with_states_over_points(arch_set):
    """Stable states over random points by another search: none, one or two."""
    chart = em.Projection(part(arch_set, arch_set.cell_index == 0))
    at = np.random.default_rng(8).uniform((0.2, -2.0), (2.5, 2.0), (1500, 2))
    with unchecked():
        found = chart.state(at)
        over = arch_set.over(Theta=at[:, 0], Delta=at[:, 1])
    count = np.bincount(over.point[over.index == 0], minlength=len(at))
    wanted = np.array(["gap", "inside", "not single-valued"])[count]
    assert np.array_equal(found.status, wanted)


def test_heights_and_actuator_are_coordinates_of_the_arch_until_it_folds_them(arch_set):
    """chart∘inverse to 1e-10 wherever there is one state."""
    arch = arch_set.structure
    with unchecked():
        chart = em.DescriptorChart(
            part(arch_set, arch_set.cell_index == 0), [arch.height(0.5), "Delta"]
        )
        at = chart.cells.values[::7] + 1e-3
        found = chart.state(at)
        assert found.inside.mean() > 0.6
        np.testing.assert_allclose(
            chart.coords(found.states[found.inside]), at[found.inside], rtol=0, atol=1e-10
        )
        assert found.states[found.inside].residual.max() < 1e-10
        assert (chart.singular.states.residual < 1e-9).all()


def test_wrong_coordinates_are_refused(spring_set):
    angle = spring_set.structure.angle
    twice = em.Descriptor("twice", "rad", lambda z, p: 2.0 * z[:, 0])
    for chosen, message in (
        ([angle], "`coordinates` must be 2, one per free parameter"),
        ([angle, angle], "`coordinates` must be different ones"),
        ([angle, twice], "`coordinates` must be independent; got angle, twice"),
        ([angle, "k"], "`coordinates` must be free parameters .* which is fixed"),
        ([angle, "volume"], "`descriptor` must be one of angle, height, energy"),
    ):
        with pytest.raises(InputError, match=message):
            em.DescriptorChart(spring_set, chosen)
    empty = part(spring_set, spring_set.cell_index == 5)
    with pytest.raises(InputError, match="`eset` must have cells; got an empty set"):
        em.Projection(empty)
    chart = em.Projection(spring_set)
    with pytest.raises(InputError, match=r"`coords` must be rows of 2 numbers \(x_l, F\)"):
        chart.state(np.zeros((3, 1)))
    with pytest.raises(InputError, match="`coords` must be an array of finite numbers"):
        chart.state(np.array([[np.nan, 0.0]]))


def questions(eset, count):
    """States of a set: random places in its cells, corrected onto it at their parameters."""
    generator = np.random.default_rng(7)
    cells = eset.cells[own := generator.integers(len(eset.cells), size=count)]
    weights = generator.dirichlet(np.ones(cells.shape[1]), size=count)
    z, p = (
        np.einsum("nk,nki->ni", weights, column[cells]) for column in (eset.points.z, eset.points.p)
    )
    found = settle(eset.structure, z, p)
    states = em.States(eset.structure, found.z, found.p)
    good = np.flatnonzero(found.found)
    return states[good[states[good].index == eset.cell_index[own[good]]]]


def answers(eset, chosen):
    """Answers of a chart to the coordinates of states, checked where it has one."""
    chart, states = em.DescriptorChart(eset, chosen), questions(eset, 300)
    found = chart.state(chart.coords(states))
    own = np.flatnonzero(found.inside)
    np.testing.assert_allclose(found.states.z[own], states.z[own], rtol=0, atol=1e-8)
    np.testing.assert_allclose(found.states.p[own], states.p[own], rtol=0, atol=1e-8)
    return found


@pytest.mark.parametrize(
    "chosen",
    [("angle", "x_l"), ("angle", "F"), ("height", "F"), ("energy", "x_l"), ("energy", "angle")],
)
def test_a_chart_of_the_spring_gives_no_other_of_two_states(spring_set, chosen):
    """What a chart calls the only state is the one that was asked for: 4 of 720 were not.

    (x_l, E) never is unique: δ and −δ.
    """
    with unchecked():
        found = answers(spring_set, chosen)
    if chosen == ("energy", "x_l"):
        assert not found.inside.any()
    if chosen[0] != "energy":
        assert found.inside.all()


@pytest.mark.parametrize("largest", [0, 1, 13])
def test_a_chart_of_the_arch_gives_no_other_of_two_states(largest):
    """Close to det J = 0 one of a pair lies outside of all flat cells: 27 of 2600 were wrong."""
    eset = arch_set()
    rod = eset.structure
    with unchecked():
        eset = part(eset, eset.cell_index <= largest)
        crown, third, other = rod.height(1 / 2), rod.height(1 / 3), rod.height(2 / 3)
        for chosen in ((third, other), (crown, "Delta"), (other, "Delta")):
            answers(eset, chosen)
        # the mirror image of a state has the same crown and Θ
        assert not answers(eset, (crown, "Theta")).inside.any()
