"""Pieces of the spring's and the arch's sets: sizes in closed form, exact cuts, what can be led."""

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.manifold import components, equilibrium_set, refine
from equimorph.model import Box, function_of
from equimorph.structures import Spring
from equimorph.tasks.planning.planner import plan
from typecheck import unchecked

TILT = 0.2


@pytest.fixture(scope="module")
def fine_spring(spring_set):
    with unchecked():
        return refine(spring_set, 0.015)


@pytest.fixture(scope="module")
def tilted(fine_spring):
    """Stable states at least 0.2 off the axis."""
    square = function_of("square", lambda angle: angle**2, fine_spring.structure.angle)
    with unchecked():
        return components(fine_spring, stable=True, within=[square >= TILT**2])


def area(low: float) -> float:
    """Area of (δ, x_l, F) with F = (1 − x_l/cos δ) sin δ over stable δ ≥ low, by the midpoint rule.

    Of first order at the ragged sides: 1e-3 at 2000 × 2000 points.
    """
    delta, x = np.meshgrid(
        low + (1.5 - low) * (np.arange(2000) + 0.5) / 2000,
        0.3 + (np.arange(2000) + 0.5) / 2000,
        indexing="ij",
    )
    force = (1 - x / np.cos(delta)) * np.sin(delta)
    slope = np.cos(delta) - x / np.cos(delta) ** 2
    density = np.sqrt(1 + slope**2 + np.tan(delta) ** 2)
    inside = (np.abs(force) <= 0.5) & (x > np.cos(delta) ** 3)
    return float(density[inside].sum() * (1.5 - low) / 2000 / 2000)


def test_the_whole_set_and_its_stable_part(fine_spring):
    """Around x_l > 1 the stable part hangs together; the unstable part is the other stratum."""
    with unchecked():
        whole, stable = components(fine_spring), components(fine_spring, stable=True)
    assert (len(whole), len(stable)) == (1, 1)
    assert [each.indices for each in stable.about] == [(0,)]
    assert stable.sizes[0] == pytest.approx(2 * area(0.0), rel=1e-2)
    assert whole.sizes[0] > stable.sizes[0]


def test_pieces_are_cut_exactly_along_the_bound(tilted):
    """|δ| ≥ 0.2 leaves two mirror images; tolerance: the midpoint rule and flat triangles."""
    assert (len(tilted), tilted.uncut) == (2, 0)
    assert tilted.eset.audit.clean
    np.testing.assert_allclose(tilted.sizes, area(TILT), rtol=1e-2)
    capped = [each.vertices for each in tilted.eset.boundaries if each.kind != "box"]
    delta = np.abs(tilted.eset.points.z[np.concatenate(capped), 0])
    x = tilted.eset.points["x_l"][np.concatenate(capped)]
    on_bound, on_fold = np.abs(delta - TILT) < 1e-10, np.abs(x - np.cos(delta) ** 3) < 1e-8
    # the sides of the box close the loops
    at_side = (np.abs(np.abs(tilted.eset.points["F"][np.concatenate(capped)]) - 0.5) < 1e-9) | (
        (np.abs(x - 0.3) < 1e-9) | (np.abs(x - 1.3) < 1e-9)
    )
    assert (on_bound | on_fold | at_side).all()
    assert on_bound.sum() > 10
    signs = [np.sign(piece.points.z[:, 0]) for piece in tilted]
    assert [set(each.tolist()) for each in signs] in ([{1.0}, {-1.0}], [{-1.0}, {1.0}])


def test_states_know_their_piece(tilted, fine_spring):
    here = fine_spring.at(x_l=0.8, F=0.01)
    low, middle, high = (here[int(k)] for k in np.argsort(here.z[:, 0]))
    assert {tilted.number_of(low), tilted.number_of(high)} == {0, 1}
    assert tilted.number_of(middle) is None
    assert not tilted.joined(low, high)
    assert not tilted.joined(middle, middle)
    above = fine_spring.at(x_l=0.6, F=-0.1)
    assert tilted.joined(high, above[int(above.z[:, 0].argmax())])
    flat = fine_spring.at(x_l=1.2, F=0.0)[0]
    assert flat.stable
    assert tilted.number_of(flat) is None


def test_pieces_of_the_arch_are_what_routes_can_join(even_arch_set):
    """Upright to inverted: within max |κ| ≤ 11, a band of rises is as wide as the cells."""
    arch = even_arch_set.structure
    rise = arch.height(0.5)
    apart = function_of("bow", lambda height: height**2, rise) >= 0.12**2
    with unchecked():
        here = even_arch_set.at(Theta=1.0, Delta=0.0).stable
        up, down = max(here, key=rise), min(here, key=rise)
        for within in ([arch.max_curvature <= 11], [apart]):
            pieces = components(even_arch_set, stable=True, within=within)
            route = plan(even_arch_set, up, down, within=within)
            assert pieces.joined(up, down) == (route.status == "arrived") == (within[0] != apart)
            assert (np.diff(pieces.sizes) <= 0).all()


@pytest.mark.parametrize(
    ("box", "fixed", "intervals", "number"),
    [
        (Box(F=(-0.4, 0.4)), {"x_l": 0.7}, (9,), 2),
        (Box(x_l=(0.5, 0.9), F=(-0.3, 0.3), k=(0.8, 1.2)), {}, (4, 5, 2), 2),
    ],
    ids=["d=1", "d=3"],
)
def test_pieces_over_one_and_three_parameters(box, fixed, intervals, number):
    """x_l < 1: the stable branches above and below are apart.

    3 %: coarse cells are no mirror images.
    """
    spring = Spring()
    with unchecked():
        eset = equilibrium_set(spring, box, fixed=fixed, intervals=intervals, checks=0)
        stable = components(eset, stable=True)
        upper = components(eset, stable=True, within=[spring.angle >= 0])
    assert (len(components(eset)), len(stable), len(upper)) == (1, number, 1)
    np.testing.assert_allclose(stable.sizes, upper.sizes[0], rtol=3e-2)


@pytest.fixture(scope="module")
def four_branches():
    """Stable states of the spring at x_l = 0.7, without δ in (0.85, 0.95), (−0.85, −0.75)."""
    with unchecked():
        eset = equilibrium_set(
            Spring(), Box(F=(-0.4, 0.2)), fixed={"x_l": 0.7}, intervals=(40,), checks=0
        )
        bands = [
            function_of(
                f"from {middle}", lambda angle, at=middle: (angle - at) ** 2, Spring().angle
            )
            for middle in (0.9, -0.8)
        ]
        return components(eset, stable=True, within=[band >= 0.05**2 for band in bands])


def branch_lengths() -> dict[tuple[float, float], float]:
    """Length of every branch by its interval of δ; F = (1 − x_l/cos δ) sin δ, ds² = dδ² + dF²."""
    delta = np.linspace(-1.2, 1.2, 2400001)
    force = (1.0 - 0.7 / np.cos(delta)) * np.sin(delta)
    away = (np.abs(delta - 0.9) >= 0.05) & (np.abs(delta + 0.8) >= 0.05)
    kept = (np.cos(delta) ** 3 < 0.7) & away & (force > -0.4) & (force < 0.2)
    ends = np.flatnonzero(np.diff(np.pad(kept.astype(int), 1)))
    return {
        (delta[a], delta[b - 1]): np.hypot(np.diff(delta[a:b]), np.diff(force[a:b])).sum()
        for a, b in ends.reshape(-1, 2)
    }


def test_pieces_are_numbered_from_the_largest_with_their_cells_and_strata(four_branches):
    """Closed form of each branch; tolerance: chords instead of arcs."""
    exact = sorted(branch_lengths().items(), key=lambda item: -item[1])
    assert len(four_branches) == len(exact) == 4
    np.testing.assert_allclose(four_branches.sizes, [size for _, size in exact], rtol=5e-3)
    strata = four_branches.eset.strata
    for number, (piece, ((low, high), _)) in enumerate(zip(four_branches, exact, strict=True)):
        delta = piece.points.z[:, 0]
        assert (delta.min(), delta.max()) == pytest.approx((low, high), abs=1e-5)
        assert four_branches.about[number].cells == len(piece.cells)
        inner = piece.points[int(np.argmin(np.abs(delta - (low + high) / 2)))]
        assert four_branches.number_of(inner) == number
        assert sum(each.cells for each in strata if each.component == number) == len(piece.cells)


def test_nothing_may_be_left(spring_set):
    spring = spring_set.structure
    with unchecked():
        nothing = components(spring_set, stable=True, within=[spring.angle >= 2])
    assert (len(nothing), list(nothing)) == (0, [])
    assert nothing.number_of(spring_set.at(x_l=0.8, F=0.0)[0]) is None
    assert repr(nothing).endswith("angle >= 2: 0")


def test_pieces_can_be_read(tilted):
    lines = repr(tilted).splitlines()
    assert lines[0].endswith("square >= 0.04: 2")
    assert "index 0, Euler characteristic 1" in lines[1]


def test_wrong_questions_about_pieces_are_refused(spring_set, tilted):
    with unchecked(), pytest.raises(InputError, match="`within` must be a list of constraints"):
        components(spring_set, within=["angle <= 1"])
    with pytest.raises(IndexError, match="2 pieces; got number 2"):
        tilted[2]
    with pytest.raises(InputError, match="must have the fixed parameters"):
        tilted.number_of(Spring().natural_state(x_l=0.8, k=2.0))
