"""Edges that are hard to lift have every attempt, one after the other."""

import numpy as np
import pytest

from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.lifting import edges
from equimorph.manifold.lifting.grid import grid_lines, grid_mesh
from equimorph.manifold.lifting.pairing import Pairing, Rays, start_pairing
from equimorph.model import Box
from equimorph.structures import Spring


@pytest.fixture
def pairing() -> Pairing:
    """Three points over either end of an edge."""
    spring, box = Spring(), Box(x_l=(0.5, 1.2), F=(-0.3, 0.3))
    setting = Setting(spring, np.array([0.5, 0.0, 1.0]), np.array([0, 1]), ())
    mesh = grid_mesh(grid_lines(box, (1, 1)))
    found = start_pairing(setting, mesh, 100)
    vertices = np.repeat(mesh.edges[0], 3)
    z, index = np.arange(6.0)[:, None], np.zeros(6, int)
    found.points.over_vertices(vertices, z, setting.parameters(mesh.vertices[vertices]), index)
    found.fit()
    return found


def test_contradictions_of_one_attempt_raise_the_effort_once(pairing):
    """The first attempt used up all where four curves contradicted each other.

    So it was beside a pitchfork of a frame: set 774 of the soak had 416 unpaired curves.
    """
    for start in (0, 1, 0, 1, 0, 1):
        pairing.enter(start, 0, 3, tried=1)
    assert (pairing.conflicts, pairing.effort[0]) == (3, 2)


def test_rays_that_are_lost_together_have_another_attempt_together(pairing, monkeypatch):
    nothing, none = np.zeros((0, 1)), np.zeros(0, int)
    inside = edges.Inside(none, nothing, np.zeros((0, 3)), none, none)
    lost = edges.Traced(np.zeros(3, bool), np.full(3, -1), nothing, none, inside)
    monkeypatch.setattr(edges, "_follow", lambda *_: lost)
    rays = Rays(np.arange(3), np.zeros(3, int), np.zeros(3, int))
    tried = []
    for _ in range(edges.EFFORTS):
        tried.append(int(pairing.effort[0]))
        edges.trace_rays(pairing, rays)
    assert tried == list(range(edges.EFFORTS))
