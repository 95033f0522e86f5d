"""Kernels of frames in space against plain numpy, at random states."""

import numpy as np
import pytest

import equimorph as em
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.space_frame.derivative_kernels import equations_lanes
from equimorph.structures.spatial.mechanics import pairs_of
from oracles.frame_twins import equations, moments
from oracles.specimens import specimens

FRAMES = {
    each.name: each for each in specimens() if isinstance(each.structure, em.SpatialFrame)
}  # fmt: skip
LANES = 13


@pytest.fixture(params=FRAMES, scope="module")
def case(request):
    """A frame, random states with lengths near 1, and a generator."""
    specimen, generator = FRAMES[request.param], np.random.default_rng(5)
    frame = specimen.structure
    p = specimen.centre + 0.3 * generator.normal(size=(LANES, len(frame.parameters)))
    z = frame.sample(p, generator)
    z[:, : frame.unknowns] += 0.05 * generator.normal(size=(LANES, frame.unknowns))
    return frame, z, p, generator


def close(value, wanted, tolerance):
    assert np.abs(value - wanted).max() <= tolerance * np.abs(wanted).max()


def test_frames_have_hinges_and_held_ends_that_turn():
    models = [each.structure.model for each in FRAMES.values()]
    assert any(len(model.hinged) for model in models)
    assert any(model.patterns.turns[:, model.held].any() for model in models)
    assert any(model.compliance.any() for model in models)
    assert any(model.multipliers for model in models)


def test_derivatives_equal_those_of_plain_jets(case):
    """Tolerance: round-off of some hundred terms."""
    frame, z, p, generator = case
    ways = [(generator.normal(size=z.shape), generator.normal(size=p.shape)) for _ in range(2)]
    for k in range(3):
        moves = [
            np.stack([way[i] for way in ways[:k]], axis=1) if k else np.zeros((LANES, 0, width))
            for i, width in enumerate((z.shape[1], p.shape[1]))
        ]
        out = np.empty((LANES, 2**k, frame.size))
        shared = (*pairs_of(2**k), *frame.tables.of_jets)
        over_lanes(equations_lanes, shared, [z, p, *moves], [out])
        for part, wanted in enumerate(equations(frame, z, p, *ways[:k])):
            close(out[:, part], wanted, 1e-14)
    np.testing.assert_array_equal(frame.second_derivative(z, p, *ways), out[:, 3])


def test_moments_equal_plain_numpy(case):
    """Tolerance: round-off of some hundred terms."""
    frame, z, p, _ = case
    wanted = moments(frame, z, p)
    close(frame.moments(z, p), wanted, 1e-13)
    sections = np.einsum("leica,leic->leia", frame.cross_sections(z, p), wanted)
    close(frame.section_moments(z, p), sections, 1e-13)


@pytest.mark.parametrize("lanes", [1, 5, 8])
def test_lanes_do_not_depend_on_each_other(case, lanes):
    frame, z, p, generator = case
    ways = [(generator.normal(size=z.shape), generator.normal(size=p.shape)) for _ in range(2)]
    whole = frame.second_derivative(z, p, *ways)
    some = [(dz[:lanes], dp[:lanes]) for dz, dp in ways]
    alone = frame.second_derivative(z[:lanes], p[:lanes], *some)
    np.testing.assert_array_equal(alone, whole[:lanes])
    moments_alone = frame.section_moments(z[:lanes], p[:lanes])
    np.testing.assert_array_equal(moments_alone, frame.section_moments(z, p)[:lanes])
