"""Constraints that are violated between neighbouring vertices of the grid only."""

import numpy as np
import pytest

import equimorph as em
from equimorph.manifold.lifting.grid import grid_lines

DEGREE = 7
NAMES = [f"c{k}" for k in range(DEGREE + 1)]


def wells(names, descriptor, parameters):
    """One well over each point; the descriptor is any function of its place."""
    axes, letters = "xy"[: len(parameters)], "".join(parameters)
    energy = " + ".join(
        f"(({u} - {p} - {0.2 * k}*x**2)**2)/2"
        for k, (u, p) in enumerate(zip(axes, letters, strict=True))
    )
    loads = [em.Parameter(name, "1", 1.0, "load", 0.0) for name in parameters]
    given = [em.Parameter(name, "1", 1.0, "fixed", 1.0) for name in names]
    return em.EnergyStructure(
        f"{energy} + 1e-30*x*({' + '.join(names)})",
        [em.Unknown(u, 0.0, (-4, 4)) for u in axes],
        [*loads, *given],
        descriptors={"D": descriptor},
    )


@pytest.fixture(scope="module")
def line():
    return wells(NAMES, " + ".join(f"{name}*x**{k}" for k, name in enumerate(NAMES)), "P")


@pytest.fixture(scope="module")
def plane():
    return wells("abcw", "w**2/4 - (a*x + b*(y - x**2/5) + c*x**2 - 0.55)**2", "PQ")


@pytest.fixture(scope="module")
def strips():
    """Allowed within w/2 of a curve, and farther than 0.1 from there."""
    u = "(a*x + b*(y - x**2/5) + c*x**2 - 0.2)"
    return wells("abcw", f"-({u}**2 - w**2/4)*({u}**2 - (0.5*w + 0.1)**2)", "PQ")


def covered(eset):
    """Intervals of the parameter that cells cover, joined where they meet."""
    ends = np.sort(eset.coordinates[eset.cells][:, :, 0], axis=1)
    joined = []
    for a, b in ends[np.argsort(ends[:, 0])].tolist():
        if joined and a <= joined[-1][1] + 1e-9:
            joined[-1][1] = b
        else:
            joined.append([a, b])
    return np.array(joined)


@pytest.mark.parametrize("width", [0.1, 0.03, 0.01])
def test_violations_narrower_than_an_interval_part_a_set_over_one_parameter(line, width):
    draw = np.random.default_rng(int(1000 * width))
    for intervals in (5, 8, 11):
        # far enough apart that a vertex lies between
        a = np.array([0.5, 1.7]) + draw.uniform(0.0, 0.6, 2)
        excess = np.poly1d([-1.0])
        for place in a:
            excess = excess * np.poly1d([1.0, -2.0 * place, place**2 - width**2 / 4.0])
        fixed = dict.fromkeys(NAMES, 0.0) | dict(
            zip(NAMES, excess.coeffs[::-1].tolist(), strict=False)
        )
        within = [line.descriptor("D") <= 0.0, line.descriptor("D") >= -1e3]
        box = em.Box(P=(0.0, 3.0))
        eset = em.equilibrium_set(
            line, box, fixed=fixed, within=within, intervals=[intervals], checks=0
        )
        first, second = a
        edges = [0.0, first - width / 2, first + width / 2, second - width / 2]
        edges += [second + width / 2, 3.0]
        assert covered(eset).ravel() == pytest.approx(edges, abs=1e-6)
        assert eset.audit.clean


def test_pieces_between_two_violations_over_one_parameter(line):
    """No vertex lies in them: all of these were missing, half of them under a clean audit."""
    draw = np.random.default_rng(4)
    within = [line.descriptor("D") <= 0.0, line.descriptor("D") >= -1e3]
    for width in np.geomspace(0.009, 0.1, 10):
        intervals = int(draw.integers(4, 9))
        lines = grid_lines(em.Box(P=(0.0, 3.0)), (intervals,))[0]
        middle = 0.5 * (lines[2] + lines[3]) + draw.uniform(-0.05, 0.05)
        first, last = middle - width / 2, middle + width / 2
        ends = [first - draw.uniform(0.02, 0.2), first, last, last + draw.uniform(0.02, 0.2)]
        excess = -np.poly1d(ends, True)
        fixed = dict.fromkeys(NAMES, 0.0)
        fixed |= dict(zip(NAMES, excess.coeffs[::-1].tolist(), strict=False))
        eset = em.equilibrium_set(
            line, em.Box(P=(0.0, 3.0)), fixed=fixed, within=within, intervals=[intervals]
        )
        assert covered(eset).ravel() == pytest.approx([0.0, *ends, 3.0], abs=1e-6)
        assert eset.audit.clean


def test_pieces_between_two_violations_over_two_parameters(strips):
    """Cells of 0.4 to 0.5: cells of the pieces beside these were thought to have their states."""
    draw = np.random.default_rng(1)
    for width in np.geomspace(0.006, 0.1, 8):
        angle, bow = draw.uniform(0.0, 2.0 * np.pi), draw.uniform(-0.2, 0.2)
        eset = em.equilibrium_set(
            strips,
            em.Box(P=(-1.5, 1.5), Q=(-1.5, 1.5)),
            fixed={"a": np.cos(angle), "b": np.sin(angle), "c": bow, "w": width},
            within=[strips.descriptor("D") <= 0.0],
            intervals=[7, 6],
        )
        assert (eset.audit.components, eset.audit.clean) == (3, True)


def in_cells(eset, places):
    """Which places over the parameters lie in cells."""
    corners = eset.coordinates[eset.cells]
    spans = np.swapaxes(corners[:, 1:] - corners[:, :1], 1, 2)
    shares = np.einsum("tij,ptj->pti", np.linalg.inv(spans), places[:, None] - corners[:, 0])
    return ((shares > 0.0).all(axis=2) & (shares.sum(axis=2) < 1.0)).any(axis=1)


def test_strips_of_violation_narrower_than_the_grid_are_cut_out(plane):
    """Of 20 such sets all were one piece that covered the strip, and 19 had a clean audit."""
    draw = np.random.default_rng(0)
    for width in (0.1, 0.1, 0.03, 0.03):
        angle, bow = draw.uniform(0.0, 2.0 * np.pi), draw.uniform(-0.5, 0.5)
        a, b = np.cos(angle), np.sin(angle)
        eset = em.equilibrium_set(
            plane,
            em.Box(P=(-1.0, 1.0), Q=(-1.0, 1.0)),
            fixed={"a": a, "b": b, "c": bow, "w": width},
            within=[plane.descriptor("D") <= 0.0],
            intervals=[9, 9],
            checks=0,
        )
        assert eset.audit.clean
        places = draw.uniform(-1.0, 1.0, (20_000, 2))
        off = np.abs(a * places[:, 0] + b * places[:, 1] + bow * places[:, 0] ** 2 - 0.55)
        assert not in_cells(eset, places[off < 0.1 * width]).any()
        assert in_cells(eset, places[off > 0.1]).all()
