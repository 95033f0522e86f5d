"""Folds that turn in coarse grid cells, or pass them side by side: which of them belong together.

The structures are quintics in x whose coefficients are quadratic in the parameters; their roots
are all the equilibria there are.
"""

import numpy as np
import pytest

import equimorph as em
from equimorph.manifold.lifting import cells
from equimorph.manifold.lifting.cells import volumes_over
from typecheck import unchecked

SIZES = 2.0, 1.5, 1.0, 0.6
"""Of the coefficients of x³, x², x and 1."""
POINTS = 100


class Quintic:
    """x⁵ + (A − 1) x³ + B x² + C x + D = 0, with random quadratic forms A to D."""

    def __init__(self, seed, dimension):
        generator = np.random.default_rng([5, seed, dimension])
        self.names = "pqr"[:dimension]
        self.forms = []
        for size in SIZES:
            linear = generator.uniform(-1, 1, dimension)
            square = generator.uniform(-1, 1, (dimension, dimension))
            constant = size * generator.uniform(-1, 1)
            self.forms.append((constant, size * linear, 0.7 * size * square))
        self.intervals = tuple(generator.integers(2, 5 if dimension == 2 else 4, dimension))
        self.places = generator.uniform(-1, 1, (POINTS, dimension))

    def roots(self, place):
        values = [a + b @ place + place @ c @ place for a, b, c in self.forms]
        found = np.roots([1.0, 0.0, values[0] - 1.0, *values[1:]])
        return np.sort(found.real[np.abs(found.imag) < 1e-9])

    def lifted(self, **options):
        a, b, c, d = (self._text(*form) for form in self.forms)
        start = float(self.roots(np.zeros(len(self.names)))[0])
        structure = em.EnergyStructure(
            f"x**6/6 + ({a} - 1)*x**4/4 + {b}*x**3/3 + {c}*x**2/2 + {d}*x",
            [em.Unknown("x", start, guesses=(-3.0, 3.0))],
            [em.Parameter(name, "1", 1.0, "actuator", 0.0) for name in self.names],
        )
        box = em.Box(**dict.fromkeys(self.names, (-1.0, 1.0)))
        with unchecked():
            return em.equilibrium_set(structure, box, intervals=self.intervals, **options)

    def _text(self, constant, linear, square):
        terms = [f"({constant:.17g})"]
        terms += [f"({v:.17g})*{name}" for name, v in zip(self.names, linear, strict=True)]
        terms += [
            f"({v:.17g})*{one}*{other}"
            for one, row in zip(self.names, square, strict=True)
            for other, v in zip(self.names, row, strict=True)
        ]
        return f"({' + '.join(terms)})"


def assert_right(eset, quintic):
    """Clean, with all roots at random points, and no grid vertex off the cells."""
    assert eset.audit.clean, eset.audit
    for place in quintic.places:
        states = eset.at(**dict(zip(quintic.names, place, strict=True)))
        found = np.sort([state.z[0] for state in states])
        assert found == pytest.approx(quintic.roots(place), abs=1e-6)
    assert len(np.unique(eset.mesh.cells)) == len(eset.mesh.vertices)


@pytest.mark.parametrize(("dimension", "seed"), [(2, 6), (2, 9), (2, 10), (3, 0), (3, 5)])
def test_folds_that_turn_in_coarse_cells_need_no_bisection(dimension, seed):
    """By the normals at their ends, 2, 3, 15, 21 and 26 cells were bisected."""
    quintic = Quintic(seed, dimension)
    eset = quintic.lifted()
    assert_right(eset, quintic)
    assert eset.audit.bisected == 0


@pytest.mark.slow
@pytest.mark.parametrize(("dimension", "count", "most"), [(2, 40, 2), (3, 7, 1)])
def test_random_quintics_are_whole(dimension, count, most):
    """By the normals, 40 cells of 40 sets were bisected, and 147 of seven over three parameters.

    Of these 22 were where closed curves over edges were not known.
    """
    bisected = 0
    for seed in range(count):
        quintic = Quintic(seed, dimension)
        eset = quintic.lifted()
        assert_right(eset, quintic)
        bisected += eset.audit.bisected
    assert bisected <= most


@pytest.mark.slow
def test_what_a_bisection_leaves_is_found_only_once(monkeypatch):
    """Doubtful cells are divided several times; to find everything anew gives the same set.

    Without checks, which search below cells that are drawn: these stand in another order.
    """
    at_once = Quintic(3, 3).lifted(checks=0)
    assert at_once.audit.bisected > 0
    monkeypatch.setattr(cells, "volumes_over", lambda pairing, _: volumes_over(pairing, None))
    anew = Quintic(3, 3).lifted(checks=0)
    assert at_once.audit == anew.audit
    one, other = (eset.coordinates[np.lexsort(eset.coordinates.T)] for eset in (at_once, anew))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)
