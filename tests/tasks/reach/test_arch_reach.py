"""The reachable set of the arch at q = 2.5 from heights (0.15, 0.15), [Feher2025]_ figure 9.

Symmetric under y(1/3) ↔ y(2/3), which Δ → −Δ brings about; actuators within 0.2 ≤ Θ ≤ 2.5, |Δ| ≤ 2.
"""

import numpy as np
import pytest

from equimorph.tasks.motion.tracking import track
from equimorph.tasks.reach.query import jacobian_of
from equimorph.tasks.reach.reachable_sets import reachable
from sets import arch_set
from typecheck import unchecked


@pytest.fixture(scope="module")
def reach():
    eset = arch_set((24, 41), cap=60.0)
    arch = eset.structure
    left, right = arch.height(1 / 3), arch.height(2 / 3)
    with unchecked():
        up = max(eset.at(Theta=1, Delta=0).stable, key=arch.height(0.5))
        middle = track(up, {left: 0.15, right: 0.15}, actuators=["Theta", "Delta"])
        return reachable(eset, middle.path.end.state, [left, right])


def distance(points, lines):
    """Largest distance of points from polylines."""
    starts = np.concatenate([line[:-1] for line in lines])
    along = np.concatenate([np.diff(line, axis=0) for line in lines])
    gap = points[:, None] - starts
    share = np.clip((gap * along).sum(2) / np.maximum((along**2).sum(1), 1e-300), 0.0, 1.0)
    return np.linalg.norm(gap - share[:, :, None] * along, axis=2).min(axis=1).max()


def test_boundary_has_pieces_of_all_kinds_and_is_symmetric(reach):
    """Exact vertices; between them chords of cells of a few hundredths."""
    assert reach.start["Theta"] == pytest.approx(1.621098, abs=5e-7)
    kinds = ["snap-through", "singular Jacobian", "actuator limit"]
    assert {piece.kind for piece in reach.boundary} == set(kinds)
    assert reach.why == ""
    for kind in kinds:
        lines = [piece.values for piece in reach.boundary if piece.kind == kind]
        assert distance(np.concatenate(lines)[:, ::-1], lines) < 2e-3
    side = reach.home.values[reach.home.eset.cells].mean(axis=1)
    above = np.sign(side[:, 1] - side[:, 0])
    sizes = np.abs(np.linalg.det(np.diff(reach.home.values[reach.home.eset.cells], axis=1)))
    assert abs((above * sizes).sum()) < 0.01 * sizes.sum()


def test_vertices_of_the_boundary_are_what_they_are_called(reach):
    structure = reach.start.structure
    det = jacobian_of(structure, ("Theta", "Delta"), reach.descriptors)
    size = np.abs(det(reach.start))
    for piece in reach.boundary:
        assert np.abs(piece.states.residual).max() < 1e-10
        if piece.kind == "snap-through":
            assert np.abs(piece.states.margin).max() < 1e-6
        elif piece.kind == "singular Jacobian":
            # the last vertices lie on the fold, where derivatives along Θ and Δ do not exist
            regular = piece.states.margin > 1e-3
            assert np.abs(det(piece.states[regular])).max() < 1e-7 * size
        else:
            name, _, bound = piece.detail.partition(" = ")
            assert piece.states[name] == pytest.approx(float(bound), abs=1e-9)
    details = {piece.detail for piece in reach.boundary if piece.detail}
    assert {"Theta = 2.5", "Delta = -2", "Delta = 2"} <= details


def test_on_the_diagonal_the_jacobian_ends_the_set_before_the_snap(reach):
    """By symmetry of the arch the highest equal heights lie where det J_S = 0 at Δ = 0."""
    left, right = reach.descriptors
    beyond = reach.query({left: 0.25, right: 0.25})
    assert not beyond.can
    assert beyond.straight.failure == "singular Jacobian"
    assert beyond.straight.path.end.state["Delta"] == pytest.approx(0.0, abs=1e-8)
    tip = left(beyond.straight.path.end.state)
    curve = [p.values for p in reach.boundary if p.kind == "singular Jacobian"]
    assert distance(np.array([[tip, tip]]), curve) < 1e-3
    for x, y in [(0.1, 0.1), (0.2, 0.1), (0.2, 0.2), (0.1, 0.2)]:
        corner = reach.query({left: x, right: y})
        assert corner.can
        assert corner.margin > 0.0


@pytest.mark.slow
def test_queries_agree_with_the_image(reach):
    """Places more than the chords' error away from the boundary: in the image or not."""
    left, right = reach.descriptors
    generator = np.random.default_rng(7)
    lines = [piece.values for piece in reach.boundary]
    tested = [0, 0]
    with unchecked():
        for place in generator.uniform(-0.1, 0.25, (60, 2)):
            if distance(place[None], [*lines]) < 4e-3:
                continue
            covered = int(reach.home.covering(place[None])[0])
            answer = reach.query({left: place[0], right: place[1]})
            assert answer.can is (covered > 0), (place, answer)
            assert np.sum(answer.region == 0) == covered
            tested[covered > 0] += 1
    assert min(tested) >= 8
