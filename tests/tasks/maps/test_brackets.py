"""Where a map jumps: on synthetic maps whose jumps are known."""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria.first_stable import no_critical_states
from equimorph.tasks.maps.brackets import (
    Brackets,
    Samples,
    cells_beside,
    edges_ahead,
    grid_edges,
    narrow,
    sample_distance,
    suspicious_edges,
)
from equimorph.tasks.maps.curves import polylines

SPRING = em.Spring()


def sampler(function):
    """A map whose states are its values."""

    def sample(setting):
        value = function(*setting.T)
        p = np.zeros((len(setting), 3))
        return Samples(
            setting,
            value,
            np.zeros(len(value), int),
            np.zeros(len(value)),
            value[:, None],
            p,
            no_critical_states(len(p)),
        )

    return sample


def sharp(function, count=12, divisions=4):
    axis = np.linspace(-1.0, 1.0, count + 1)
    settings = np.stack(np.meshgrid(axis, axis, indexing="ij"), axis=-1).reshape(-1, 2)
    vertices, edges = sampler(function)(settings), grid_edges((count + 1, count + 1))
    a, b = (vertices.take(edges[:, k]) for k in (0, 1))
    at = np.flatnonzero(suspicious_edges(sample_distance(SPRING, a, b), (count + 1, count + 1)))
    pairs = Brackets(a.take(at), b.take(at), at)
    return narrow(SPRING, sampler(function), pairs, divisions)


def test_a_jump_across_a_circle_is_found_to_the_width_of_the_brackets():
    """Edges of 1/6 divided into eight four times: 4e-5."""
    pairs = sharp(lambda x, y: np.where(x**2 + y**2 < 0.5, 2.0 + x, 0.1 * y))
    middle = 0.5 * (pairs.a.setting + pairs.b.setting)
    np.testing.assert_allclose(np.hypot(*middle.T), np.sqrt(0.5), atol=4.1e-5)
    line = max(polylines(middle, pairs.edge, (13, 13)), key=len)
    assert len(line) == len(pairs) + 1
    assert line[0] == line[-1]


@pytest.mark.parametrize("steep", [2.0, 10.0, 30.0])
def test_a_smooth_map_has_no_jump_however_steep(steep):
    assert len(sharp(lambda x, y: np.tanh(steep * (x + 0.3 * y)))) == 0


def test_a_jump_beside_a_steep_slope_is_found():
    """Below the jump of 0.3 a square root falls by 0.7 over the rest of the edge."""
    pairs = sharp(
        lambda x, y: np.where(y > 0.03, 1.0 + 0.1 * y, 0.7 - 2.0 * np.sqrt(np.abs(y - 0.03)))
    )
    rows = 0.5 * (pairs.a.setting + pairs.b.setting)[:, 1]
    assert len(pairs) == 13
    np.testing.assert_allclose(rows, 0.03, atol=5e-5)


def test_every_inner_edge_has_a_cell_on_both_sides():
    edges = np.arange(len(grid_edges((3, 4))))
    cells = cells_beside(edges, (3, 4))
    counts = np.bincount(cells[cells >= 0], minlength=6)
    assert counts.tolist() == [4] * 6
    assert (cells < 0).sum() == 10  # edges on the rim


def test_a_line_that_ends_inside_points_to_the_edges_of_the_cell_that_it_entered():
    """Vertices 3 × 3; the edge from vertex 4 to 5 has the cells 1 and 3 beside it."""
    number = int(np.flatnonzero((grid_edges((3, 3)) == [4, 5]).all(axis=1))[0])
    ahead = edges_ahead(np.array([number]), (3, 3))
    ends = {tuple(edge) for edge in grid_edges((3, 3))[ahead].tolist()}
    assert ends == {(1, 4), (2, 5), (1, 2), (4, 5), (4, 7), (5, 8), (7, 8)}


def test_open_lines_run_from_one_loose_end_to_the_other():
    edges = grid_edges((2, 4))
    across = [int(np.flatnonzero((edges == [k, k + 4]).all(axis=1))[0]) for k in (2, 0, 3, 1)]
    points = np.array([[0.5, 2.0], [0.5, 0.0], [0.5, 3.0], [0.5, 1.0]])
    (line,) = polylines(points, np.array(across), (2, 4))
    assert points[line, 1].tolist() in ([0, 1, 2, 3], [3, 2, 1, 0])
