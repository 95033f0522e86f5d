"""Elliptic umbilics: two sheets change places around a narrow tube of folds with three edges.

``x² − y² + C x = A`` and ``−2 x y + C y = B``, whose states are the roots of a quartic in x.
"""

import numpy as np
import pytest

import equimorph as em
from equimorph.equilibria.point_conditions import EqualEigenvalues
from equimorph.equilibria.settle import settle
from typecheck import unchecked

ENERGY = "x**3/3 - x*y**2 + ({C})*(x**2 + y**2)/2 - ({A})*x - ({B})*y"
LENGTHS = 1.1, 1.2, 1.0
"""Of the box, on both sides."""


class Umbilic:
    """The sections A and B across the tube, and C along it, as random functions of a, b and c."""

    def __init__(self, seed):
        draw = np.random.default_rng([19, seed])
        self.linear = np.eye(3) + draw.uniform(-0.25, 0.25, (3, 3))
        self.square = draw.uniform(-0.15, 0.15, 3)
        self.shift = draw.uniform(-0.15, 0.15)

    def sections(self, p):
        across = p @ self.linear.T + self.square * p[:, [2]] ** 2
        return across + np.array([0.0, 0.0, self.shift])

    def structure(self):
        texts = [
            " + ".join(f"({v:.17g})*{name}" for v, name in zip(row, "abc", strict=True))
            + f" + ({square:.17g})*c**2"
            for row, square in zip(self.linear, self.square, strict=True)
        ]
        A, B, C = texts
        return em.EnergyStructure(
            ENERGY.format(A=A, B=B, C=f"{C} + ({self.shift:.17g})"),
            [em.Unknown(name, 0.0, guesses=(-2.0, 2.0)) for name in "xy"],
            [em.Parameter(name, "1", 1.0, "actuator", 0.0) for name in "abc"],
        )

    def lifted(self, intervals):
        box = em.Box(**{name: (-n, n) for name, n in zip("abc", LENGTHS, strict=True)})
        with unchecked():
            return em.equilibrium_set(self.structure(), box, intervals=intervals)

    def counts(self, p):
        """How many states there are, and how far a pair of roots is from being one."""
        found, near = [], []
        for A, B, C in self.sections(p).tolist():
            quartic = np.polysub(
                np.polymul([1.0, C, -A], np.polymul([-2.0, C], [-2.0, C])), [B * B]
            )
            roots = np.roots(quartic)
            real = np.abs(roots.imag) < 1e-7
            found.append(np.count_nonzero(real))
            near.append(min(np.abs(a - b) for k, a in enumerate(roots) for b in roots[:k]))
        return np.array(found), np.array(near)

    def in_the_tube(self, count, draw):
        """Points with A and B inside a circle of radius C²/4, which the tube is around."""
        c, angle = draw.uniform(-1.0, 1.0, count), draw.uniform(0.0, 2.0 * np.pi, count)
        share = draw.uniform(0.1, 0.8, count)[:, None]
        across = np.zeros((count, 2))
        for _ in range(60):
            p = np.column_stack([across, c])
            found = self.sections(p)
            wanted = (
                share * found[:, [2]] ** 2 / 4 * np.column_stack([np.cos(angle), np.sin(angle)])
            )
            across -= 0.5 * np.linalg.solve(self.linear[:2, :2], (found[:, :2] - wanted).T).T
        return np.column_stack([across, c])


@pytest.mark.parametrize(
    ("seed", "intervals"),
    [(0, (2, 2, 2)), (1, (3, 3, 3)), (2, (4, 3, 3)), (3, (3, 4, 6)), (4, (5, 5, 4))],
)
def test_sheets_that_change_places_have_a_state_between_them(seed, intervals):
    """Around every face that the tube crosses; without it, some 50 cells stayed undecided."""
    umbilic = Umbilic(seed)
    eset = umbilic.lifted(intervals)
    assert eset.audit.clean, eset.audit
    assert eset.audit.bisected <= 3 * sum(intervals)
    assert (eset.audit.components, eset.audit.euler_characteristic) == (1, 1)
    draw = np.random.default_rng(seed)
    box = np.array(LENGTHS)
    middle = umbilic.in_the_tube(100, draw)
    middle = middle[(np.abs(middle) < box).all(axis=1)]
    p = np.concatenate([draw.uniform(-box, box, (200, 3)), middle])
    wanted, near = umbilic.counts(p)
    clear = near > 0.05
    assert clear.sum() > 200
    assert (wanted[clear] == 4).sum() > 20
    a, b, c = p[clear].T
    with unchecked():
        found = [len(each.states) for each in eset.over(a=a, b=b, c=c)]
    assert np.array_equal(found, wanted[clear])


def test_two_eigenvalues_are_equal_at_single_points_of_a_plane():
    """F_z = [2x + C, −2y; −2y, C − 2x] is a multiple of the identity at x = y = 0 alone."""
    structure = Umbilic(0).structure()
    draw = np.random.default_rng(3)
    z, p = draw.uniform(-0.1, 0.1, (5, 2)), draw.uniform(-0.3, 0.3, (5, 3))
    directions = np.tile(np.eye(3)[:2], (5, 1, 1))
    condition = EqualEigenvalues(np.tile(np.eye(2), (5, 1, 1)))
    found = settle(structure, z, p, directions, (condition,))
    assert found.found.all()
    assert np.abs(found.z).max() < 1e-9
    assert np.array_equal(found.p[:, 2], p[:, 2])
    assert np.abs(Umbilic(0).sections(found.p)[:, :2]).max() < 1e-9
