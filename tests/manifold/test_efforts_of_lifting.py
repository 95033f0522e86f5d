"""Edges that are hard to lift have every attempt, one after the other."""

from dataclasses import replace

import numpy as np
import pytest

from equimorph.equilibria import TraceOptions
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.manifold.geometry.points import VertexKind
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.lifting import edges
from equimorph.manifold.lifting.grid import grid_lines, grid_mesh
from equimorph.manifold.lifting.pairing import Pairing, Rays, start_pairing
from equimorph.model import Box
from equimorph.structures import Spring
from oracles.surfaces import tricritical


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


@pytest.mark.parametrize("off", [0.0, 3e-6, 1e-4])
def test_folds_beside_a_crossing_are_kept_although_they_are_not_sharp(off):
    """x (x⁴ + b x² − a) at b = −½: folds at x = ±½ on both sides of the pitchfork at 0.

    On a flat side branch, traces locate folds by their round-off only. Those that were further than
    1e-6 from where Newton's method ended were taken for round-off of the crossing itself.
    """
    box = Box(a=(-0.3, 0.4), b=(-0.5, 0.5))
    setting = Setting(tricritical(1.0), np.zeros(2), np.array([0, 1]), ())
    pairing = start_pairing(setting, grid_mesh(grid_lines(box, (1, 1))), 100)
    vertex = int(np.flatnonzero((pairing.mesh.vertices == [0.4, -0.5]).all(axis=1))[0])
    ends = pairing.mesh.vertices[pairing.mesh.edges]
    edge = int(np.flatnonzero((ends[..., 1] == -0.5).all(axis=1))[0])
    x = np.array([[np.sqrt(0.25 + np.sqrt(0.0625 + 0.4))]])
    pairing.points.over_vertices(np.array([vertex]), x, np.array([[0.4, -0.5]]), np.zeros(1, int))
    pairing.fit()
    side = int(np.flatnonzero(pairing.mesh.edges[edge] == vertex)[0])
    line = pairing.line(Rays(np.array([0]), np.array([edge]), np.array([side])))
    options = TraceOptions(through_folds=True, through_branch_points=True)
    outcome = trace(line, x, (), options)
    z = outcome.passed.z.copy()
    z[outcome.passed.code == EventCode.FOLD] += off
    blurred = replace(outcome, passed=replace(outcome.passed, z=z))
    found = edges.points_inside(pairing, np.array([edge]), blurred, line, np.ones(1, bool))
    fold, between, crossing = VertexKind.FOLD, VertexKind.BETWEEN, VertexKind.CROSSING
    assert found.kinds.tolist() == [fold, between, crossing, between, fold]
