"""States over many points at once: all roots of closed forms, in one, two and three parameters."""

import numpy as np
import pytest

from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.manifold.lookup.over import Sheets
from equimorph.manifold.lookup.rims import nearest_rims
from equimorph.model import Box
from equimorph.structures import Spring, States
from oracles.surfaces import sphere, torus
from typecheck import unchecked

CUBE = {"F": (0, 1), "x_l": (0.5, 1), "k": (1, 2)}


def angles(x: float, force: float) -> np.ndarray:
    """All δ in (−π/2, π/2) with (1 − x/cos δ) sin δ = F/k, from a polynomial in w = e^{iδ}.

    With c = (w + 1/w)/2 and s = (w − 1/w)/2i: s c − x s − F c = 0, times 4i w².
    """
    roots = np.roots([1, -2 * x - 2j * force, 0, 2 * x - 2j * force, -1])
    delta = np.angle(roots[np.abs(np.abs(roots) - 1) < 1e-9])
    return np.sort(delta[np.cos(delta) > 1e-9])


def lifted(structure, box: Box, **options) -> EquilibriumSet:
    with unchecked():
        return equilibrium_set(structure, box, checks=0, **options)


def random_points(box: Box, count: int) -> dict[str, np.ndarray]:
    points = np.random.default_rng(5).uniform(box.lower, box.upper, (count, len(box.names)))
    return dict(zip(box.names, points.T, strict=True))


def test_states_over_random_points_are_all_roots_of_the_spring(spring_set):
    at = random_points(spring_set.box, 400)
    found = spring_set.over(**at)
    for here, x, force in zip(found, at["x_l"], at["F"], strict=True):
        np.testing.assert_allclose(np.sort(here.states.z[:, 0]), angles(x, force), atol=1e-10)


def test_points_close_to_a_fold_have_both_states_or_none(spring_set):
    """Across the fold load F = (1 − x^⅔)^{3/2}, where straight cells miss the curved fold."""
    x = np.repeat(np.linspace(0.35, 0.95, 25), 2)
    load = (1 - np.cbrt(x) ** 2) ** 1.5 * np.tile([1 - 1e-5, 1 + 1e-5], 25)
    found = spring_set.over(x_l=x, F=load)
    assert [len(here.states) for here in found] == [3, 1] * 25


def test_points_on_vertices_edges_and_the_sides_of_the_box(spring_set):
    x, grid = spring_set.coordinates, spring_set.kinds == 0
    a, b = spring_set.cells[grid[spring_set.cells].all(axis=1)].T[:2]
    points = np.concatenate([x[grid], 0.5 * (x[a] + x[b])])
    found = spring_set.over(x_l=points[:, 0], F=points[:, 1])
    number = [len(angles(*point)) for point in points]
    assert [len(here.states) for here in found] == number


def test_points_almost_on_grid_lines_keep_all_their_sheets(spring_set):
    """From 1e-12 to 1e-6 off edges and vertices of the grid, on all sides of them."""
    generator = np.random.default_rng(3)
    x, grid = spring_set.coordinates, spring_set.kinds == 0
    a, b = spring_set.cells[grid[spring_set.cells].all(axis=1)].T[:2]
    share = generator.uniform(size=(len(a), 1))
    on = np.concatenate([x[grid], share * x[a] + (1 - share) * x[b]])
    off = 10.0 ** generator.uniform(-12, -6, (len(on), 1)) * generator.normal(size=on.shape)
    points = np.clip(on + off, spring_set.box.lower, spring_set.box.upper)
    found = spring_set.over(x_l=points[:, 0], F=points[:, 1])
    number = [len(angles(*point)) for point in points]
    assert [len(here.states) for here in found] == number


@pytest.mark.parametrize("apart", [1e-3, 1e-5, 1e-7, 1e-9])
def test_both_states_are_found_next_to_a_fold_that_coarse_cells_miss(apart):
    """F = ± (1 − x^⅔)^{3/2} times 1 ± `apart`, from its cusp at x = 1 on: three states or one."""
    eset = lifted(Spring(), Box(x_l=(0.3, 1.3), F=(-0.5, 0.5)), intervals=(5, 6))
    x = np.repeat(np.linspace(0.31, 0.97, 60), 4)
    factor = np.tile([1 - apart, 1 + apart], 120) * np.tile([1, 1, -1, -1], 60)
    load = (1 - np.cbrt(x) ** 2) ** 1.5 * factor
    x, load = x[np.abs(load) < 0.5], load[np.abs(load) < 0.5]
    within = np.abs(load) < (1 - np.cbrt(x) ** 2) ** 1.5
    found = eset.over(x_l=x, F=load)
    assert [len(here.states) for here in found] == np.where(within, 3, 1).tolist()
    assert np.array_equal(found.index, found.states.index)


def test_many_points_and_single_points_have_the_same_states(spring_set):
    at = random_points(spring_set.box, 20)
    found = spring_set.over(**at)
    for k, here in enumerate(found):
        alone = spring_set.at(x_l=at["x_l"][k], F=at["F"][k])
        assert (np.diff(alone.energy) >= 0).all()
        order = np.argsort(here.states.energy)
        np.testing.assert_allclose(alone.z, here.states.z[order], rtol=0, atol=1e-12)


def test_sheets_know_their_pieces(spring_set):
    """Index counted anew; stratum and component those of the cell; the cell is over the point."""
    found = spring_set.over(**random_points(spring_set.box, 200))
    assert np.array_equal(found.index, found.states.index)
    assert (found.cell >= 0).all()
    assert np.array_equal(found.stratum, spring_set.stratum[found.cell])
    index = np.array([stratum.index for stratum in spring_set.strata])
    assert np.array_equal(index[found.stratum], found.index)
    corners = spring_set.coordinates[spring_set.cells[found.cell]]
    over = np.stack([found.states["x_l"], found.states["F"]], axis=1)
    room = 0.5 * (corners.max(axis=1) - corners.min(axis=1))
    assert (over >= corners.min(axis=1) - room).all()
    assert (over <= corners.max(axis=1) + room).all()


def test_isola_over_one_parameter():
    """x² + a² = 0.91: two states inside, none outside."""
    box = Box(a=(-1.5, 1.6))
    eset = lifted(sphere(), box, fixed={"b": 0.3}, intervals=(9,))
    at = random_points(box, 300)
    inside = 0.91 - at["a"] ** 2
    for here, square in zip(eset.over(**at), inside, strict=True):
        root = np.sqrt([square]) if square > 0 else np.zeros(0)
        np.testing.assert_allclose(np.sort(here.states.z[:, 0]), [*-root, *root], atol=1e-10)
    # just outside both folds, where cells are near, and far from all of them
    for place in (-np.sqrt(0.91) - 1e-9, np.sqrt(0.91) + 1e-3, 1.5):
        assert len(eset.at(a=place)) == 0


def test_tilted_torus_has_up_to_four_sheets():
    """All real roots of the polynomial in x, from values of its residual at five places."""
    eset = lifted(torus(0.5), Box(a=(-1.6, 1.7), b=(-1.6, 1.5)), intervals=(16, 17))
    at = random_points(eset.box, 150)
    structure = eset.structure
    for here, a, b in zip(eset.over(**at), at["a"], at["b"], strict=True):
        x = np.linspace(-2, 2, 5)
        p = np.array([[a, b]] * 5)
        coefficients = np.polyfit(x, structure.residual(x[:, None], p)[:, 0], 4)
        roots = np.roots(coefficients)
        real = np.sort(roots[np.abs(roots.imag) < 1e-7].real)
        np.testing.assert_allclose(np.sort(here.states.z[:, 0]), real, atol=1e-6)


def test_spring_over_three_parameters():
    """F/k = (1 − x_l/cos δ) sin δ: all roots at random (x_l, F, k)."""
    eset = lifted(Spring(), Box(x_l=(0.5, 1.2), F=(-0.3, 0.3), k=(0.5, 2)), intervals=(4, 5, 3))
    at = random_points(eset.box, 200)
    for here, x, force, k in zip(eset.over(**at), at["x_l"], at["F"], at["k"], strict=True):
        np.testing.assert_allclose(
            np.sort(here.states.z[:, 0]), angles(x, force / k), rtol=0, atol=1e-9
        )


def test_a_constraint_hides_what_violates_it():
    """δ ≤ 0.4, over points just inside and just outside."""
    spring = Spring()
    box = Box(x_l=(0.3, 1.3), F=(-0.5, 0.5))
    eset = lifted(spring, box, within=[spring.angle <= 0.4], intervals=(12, 12))
    x = np.linspace(0.35, 1.25, 50)
    delta = 0.4 + np.tile([-1e-4, 1e-4], 25)
    force = (1 - x / np.cos(delta)) * np.sin(delta)
    for here, each, load in zip(eset.over(x_l=x, F=force), x, force, strict=True):
        expected = angles(each, load)
        np.testing.assert_allclose(
            np.sort(here.states.z[:, 0]), expected[expected <= 0.4], rtol=0, atol=1e-9
        )


@pytest.mark.parametrize("box", [Box(F=(0, 1)), Box(F=(0, 1), x_l=(0.5, 1)), Box(**CUBE)])
def test_a_set_without_states_has_none_over_any_point(box):
    structure = Spring()
    fixed = {name: value for name, value in (("x_l", 0.8), ("k", 1.0)) if name not in box.names}
    eset = lifted(structure, box, fixed=fixed, within=[structure.angle <= -2.0])
    assert (len(eset.cells), eset.audit.clean) == (0, True)
    middle = dict(zip(box.names, box.lower + 0.5, strict=True))
    assert len(eset.at(**middle)) == 0
    assert len(eset.over(**{name: np.full(2, value) for name, value in middle.items()}).states) == 0


def test_no_points_give_no_states(spring_set):
    found = spring_set.over(x_l=np.zeros(0), F=np.zeros(0))
    assert (len(found), len(found.states)) == (0, 0)


def test_states_of_a_set_are_told_from_others(spring_set):
    """Both ways of asking agree: by the nearest cells, and by all states over the points."""
    generator = np.random.default_rng(5)
    x_l, load = generator.uniform(0.55, 1.25, 60), generator.uniform(-0.05, 0.05, 60)
    over = spring_set.over(x_l=x_l, F=load)
    known, cell = spring_set.holding(over.states)
    assert known.all()
    assert (spring_set.cell_index[cell] == over.index).all()
    moved = States(over.states.structure, over.states.z + 1e-3, over.states.p)
    known, cell = spring_set.holding(moved)
    assert not known.any()
    assert (cell == -1).all()


@pytest.mark.parametrize(
    ("at", "message"),
    [
        ({"x_l": [0.5]}, "`at` must give x_l and F; got x_l"),
        ({"x_l": [0.5], "F": [0.1, 0.2]}, "equally many values"),
        ({"x_l": [0.5, 2.0], "F": [0.1, 0.2]}, r"must lie in Box\(.*\(point 1\)"),
        ({"x_l": [np.nan], "F": [0.1]}, "must be an array of finite numbers"),
        ({"x_l": 0.5, "F": 0.1}, "must be an array of finite numbers"),
    ],
)
def test_wrong_points_are_refused(spring_set, at, message):
    with unchecked(), pytest.raises(InputError, match=message):
        spring_set.over(**{name: np.array(value) for name, value in at.items()})


def test_a_point_that_does_not_exist_ends_the_loop(spring_set):
    found = spring_set.over(x_l=np.array([0.7, 0.8]), F=np.zeros(2))
    assert len(list(found)) == 2
    with pytest.raises(IndexError, match="2 points"):
        found[2]


def test_states_over_one_point_are_asked_for_once(spring_set, monkeypatch):
    """Of states that are no equilibria none is known; the set is searched at their one point."""
    here = spring_set.at(x_l=0.8, F=0.01)[0]
    z = here.z + np.linspace(0.01, 0.02, 20)[:, None]
    strangers = States(here.structure, z, np.repeat(here.p[None], 20, axis=0))
    asked, over = [], Sheets.over
    monkeypatch.setattr(Sheets, "over", lambda self, p: asked.append(len(p)) or over(self, p))
    known, cell = spring_set.holding(strangers)
    assert asked == [1]
    assert not known.any()
    assert (cell == -1).all()


def test_only_the_nearest_rims_of_a_point_are_crossed(spring_set, monkeypatch):
    """Of all rims near a point as many as are allowed, at the least distances."""
    sheets = spring_set.sheets
    near = sheets.above.near(spring_set.coordinates[spring_set.folds[0].ravel()[:40]])
    asked = near, sheets._brims, np.ones(len(near.cell), bool), sheets.above
    hit, corner = nearest_rims(*asked)
    monkeypatch.setattr("equimorph.manifold.lookup.rims.RIMS", 1)
    few, of_few = nearest_rims(*asked)
    away = np.abs(near.weights[hit, corner]) / np.linalg.norm(
        sheets.above.maps[near.cell[hit], corner, :-1] / sheets.above.width, axis=1
    )
    assert len(few) < len(hit)
    for h, c in zip(few, of_few, strict=True):
        mine = near.point[hit] == near.point[h]
        own = (hit == h) & (corner == c)
        assert away[own] == away[mine].min()
