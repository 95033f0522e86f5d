"""Kernels of frames against plain numpy, at random states."""

import numpy as np
import pytest

import equimorph as em
from oracles.specimens import specimens

FRAMES = {each.name: each.structure for each in specimens() if isinstance(each.structure, em.Frame)}
PRESSED = "under pressure"
LANES = 13


def pressed():
    """An arch of two members under pressure."""
    joints = {"A": (0.0, 0.0), "B": (1.0, 0.5), "C": (2.0, 0.0)}
    members = [
        em.Member(("A", "B"), EI=1.2, curvature=-0.3),
        em.Member(("B", "C"), EI=1.5, hinges=["C"]),
    ]
    loads = {"p": {"pressure": ["A", "B", "C"]}, "P": {"B": (0.3, -1.0)}}
    return em.Frame(joints, members, {"A": "fixed", "C": "xy"}, loads, elements=2, degree=6)


def random_case(frame):
    """A frame, and a state and two directions, all random."""
    generator, widths = np.random.default_rng(5), (frame.size, len(frame.parameters))
    rows = [[generator.normal(size=(LANES, width)) for width in widths] for _ in range(3)]
    return frame, *map(tuple, rows)


@pytest.fixture(params=FRAMES, scope="module")
def case(request):
    """Of a frame without pressure."""
    return random_case(FRAMES[request.param])


@pytest.fixture(params=[*FRAMES, PRESSED], scope="module")
def any_case(request):
    """Of any frame."""
    return random_case(pressed() if request.param == PRESSED else FRAMES[request.param])


def tensions(frame, turns, scalars, by_turns=0):
    """P = A sin ψ + B cos ψ at the points, for scalars, or a derivative of it by ψ."""
    psi = turns[:, frame.model.nodes.ravel()] + by_turns * 0.5 * np.pi
    along = (scalars @ table.T for table in (frame.model.sine, frame.model.cosine))
    return sum(part * f(psi) for part, f in zip(along, (np.sin, np.cos), strict=True))


def test_second_derivatives_of_frames_are_those_of_their_lagrangian(case):
    """By the chain rule for P(ψ, y), of which Σ (1 + e) P + ½ γ P² is the only part not quadratic.

    Its gradient along r is Σ ((1 + e + γ P) P_r + e_r P), which is differentiated along v and w.
    """
    frame, (z, p), v, w = case
    model, n = frame.model, frame.unknowns
    y, *both = frame.scalars(z, p), *(frame.scalars(*each, 0.0) for each in (v, w))
    psi = frame.turns(z, y)
    moved = [frame.turns(each[0], own) for each, own in zip((v, w), both, strict=True)]

    def P(*along):  # noqa: N802  # as in the model
        """Derivative of P along some of the directions, given by turns and scalars."""
        turned = np.prod([turns[:, model.nodes.ravel()] for turns, _ in along] or [1.0], axis=0)
        total = turned * tensions(frame, psi, y, len(along))
        for k, (_, scalars) in enumerate(along):
            rest = [turns[:, model.nodes.ravel()] for i, (turns, _) in enumerate(along) if i != k]
            part = np.prod(rest or [1.0], axis=0)
            total = total + part * tensions(frame, psi, scalars, len(along) - 1)
        return total

    def e(scalars):
        return (scalars @ model.stretch.T)[:, model.owner]

    a, b = zip(moved, both, strict=True)
    gamma, found = model.softness, frame.second_derivative(z, p, v, w)
    for column in range(frame.size):
        turns, scalars = np.zeros_like(psi), np.zeros_like(y)
        if column < n:
            turns[:, np.flatnonzero(model.place == column)] = 1.0
        else:
            scalars[:, column - n] = 1.0
        r = turns, scalars
        value = (1.0 + e(y) + gamma * P()) * P(r, a, b) + e(r[1]) * P(a, b)
        for one, two in ((a, b), (b, a)):
            value = value + (e(one[1]) + gamma * P(one)) * P(r, two)
        value = value + gamma * P(a, b) * P(r)
        wanted = -value.sum(axis=1)
        scale = 1.0 + np.abs(found).max()
        np.testing.assert_allclose(found[:, column], wanted, rtol=0, atol=1e-12 * scale)


def test_second_derivatives_do_not_depend_on_other_lanes(case):
    frame, (z, p), (dz, dp), (ez, ep) = case
    found = frame.second_derivative(z, p, (dz, dp), (ez, ep))
    for k in range(LANES):
        own = [each[[k]] for each in (z, p, dz, dp, ez, ep)]
        alone = frame.second_derivative(*own[:2], tuple(own[2:4]), tuple(own[4:]))
        np.testing.assert_array_equal(alone[0], found[k])


def test_moments_follow_from_the_balance_of_each_element(any_case):
    """In plain numpy; see `FrameFields._moments`."""
    frame, (z, p) = any_case[:2]
    model, mesh = frame.model, frame.model.mesh
    y = frame.scalars(z, p)
    turns = frame.turns(z, y)
    strain = (y @ model.stretch.T)[:, model.owner]
    stretch = 1.0 + strain + model.softness * tensions(frame, turns, y)
    across = (stretch * tensions(frame, turns, y, 1)).reshape(LANES, *model.nodes.shape)
    local = np.einsum("eij,lej->lei", model.stiffness, turns[:, model.nodes]) - across
    if frame.pressure is not None:
        local += frame.pressure.point_moments(y, turns).reshape(local.shape)
        across += (model.weights * frame._pressed(y, turns)[1]).reshape(local.shape)
    free = np.repeat((y @ model.natural.T) * model.rigidity, mesh.elements, axis=1)
    lengths = np.outer(model.lengths, mesh.lengths).ravel()[:, None]
    density = across / model.weights.reshape(model.nodes.shape) * lengths
    change = -np.einsum("ij,lej->lei", mesh.reference.integral, density)
    first, last = -local[:, :, 0] - free, local[:, :, -1] - free
    gap = (last - first - change[:, :, -1])[:, :, None] * mesh.reference.nodes
    wanted = (first[:, :, None] + change + gap).ravel()
    found = frame._moments(z, p).ravel()
    np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


def test_moments_do_not_depend_on_other_lanes(any_case):
    frame, (z, p) = any_case[:2]
    found = frame._moments(z, p)
    for k in range(LANES):
        np.testing.assert_array_equal(frame._moments(z[[k]], p[[k]])[0], found[k])
