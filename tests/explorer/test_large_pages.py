"""The arch of the README, and sets at the limits: exactness, sizes, times."""

import time
from pathlib import Path

import numpy as np
import pytest

import equimorph as em
from webpages import Opened

pytestmark = pytest.mark.slow
POINTS = 200
STEP, ROUNDS, NEARER = 1e-5, 6, 2
"""Step of differences, Newton steps, and steps towards the nearest shape."""
MOST = 0.98
"""Share of pixels at which the state drawn is that at the parameters shown."""
NEAR = 3e-3
"""Largest distance of drawn points from those of the exact state, in units of the length."""
PICKED = """(seed) => {
  const {set, view} = explorer, size = [view.element.clientWidth, view.element.clientHeight];
  const random = () => (seed = (seed * 16807) % 2147483647) / 2147483647, found = [];
  while (found.length < %d) {
    const spot = view.pick(size[0] * random(), size[1] * random());
    if (spot) found.push({cell: spot.cell, weights: spot.weights, p: set.parameters(spot),
      shape: [...set.picture(spot).slice(0, 2 * set.words.layout[0].points)]});
  }
  return found;
}""".replace("%d", str(POINTS))
"""States under random pixels, as the page draws them."""
CPU = """async () => { const {view} = explorer, times = [];
for (let k = 0; k < 30; k++) { const start = performance.now();
explorer.hover = view.pick(200 + 12 * k, 150 + 5 * k); explorer.refresh();
times.push(performance.now() - start); } explorer.hover = null; explorer.refresh();
return Math.min(...times); }"""


@pytest.fixture(scope="module")
def arch_set() -> em.EquilibriumSet:
    """The set of the README."""
    arch = em.Rod(load="uniform")
    box = em.Box(Theta=(0.2, 2.5), Delta=(-2.0, 2.0))
    return em.equilibrium_set(arch, box, fixed={"q": 2.5}, within=[arch.max_curvature <= 20])


@pytest.fixture(scope="module")
def arch_page(arch_set, browser, tmp_path_factory) -> Opened:
    path = tmp_path_factory.mktemp("arch") / "arch.html"
    yield from _page(browser, em.explore(arch_set, None, path))


def _page(browser, path: Path):
    page = Opened(browser, path)
    page.size = path.stat().st_size
    yield page
    page.context.close()


class _Exact:
    """Exact states of a set near given ones: x = (z, free parameters), one a row.

    Derivatives are differences, independent of those of the package.
    """

    def __init__(self, eset, count):
        self.structure, self.free = eset.structure, eset.setting.free
        self.p, self.size = np.tile(eset.setting.base, (count, 1)), eset.points.z.shape[1]

    def split(self, x):
        self.p[:, self.free] = x[:, self.size :]
        return x[:, : self.size].copy(), self.p.copy()

    def residual(self, x):
        return self.structure.residual(*self.split(x))

    def shape(self, x):
        return em.States(self.structure, *self.split(x)).shape()

    def slopes(self, function, x, steps):
        """Differences along steps, which are alike for all rows or one for each."""
        pairs = [(function(x + STEP * h) - function(x - STEP * h)) / (2 * STEP) for h in steps]
        return np.stack(pairs, axis=-1)

    def newton(self, x, rows):
        """Newton's method along which products with some rows do not change; what it reached."""
        for _ in range(ROUNDS):
            slopes = self.slopes(self.residual, x, np.eye(x.shape[1]))
            value = np.concatenate([self.residual(x), np.zeros(rows.shape[:2])], axis=1)
            whole = np.concatenate([slopes, rows], axis=1)
            x = x - np.linalg.solve(whole, value[:, :, None])[:, :, 0]
        return x, np.abs(self.residual(x)).max(axis=1) < 1e-9

    def nearest(self, x, drawn):
        """The states whose shapes are nearest to drawn ones, from x on: Gauss–Newton's method."""
        for _ in range(NEARER):
            slopes = self.slopes(self.residual, x, np.eye(x.shape[1]))
            tangents = np.linalg.svd(slopes)[2][:, self.size :]
            bend = self.slopes(self.shape, x, tangents.swapaxes(0, 1))
            gap = (drawn - self.shape(x)).reshape(len(x), -1, 1)
            turn = np.linalg.pinv(bend.reshape(len(x), -1, bend.shape[-1])) @ gap
            x, found = self.newton(x + (tangents.swapaxes(1, 2) @ turn)[:, :, 0], tangents)
            assert found.all()
        return x

    def at(self, x, parameters):
        """The states at given parameters, from x on; which were found."""
        x[:, self.size :] = parameters
        rows = np.eye(x.shape[1])[self.size :]
        return self.newton(x, np.tile(rows, (len(x), 1, 1)))


def test_states_under_random_pixels_are_close_to_exact_ones(arch_set, arch_page):
    """The drawn points are within 3e-3 of the length of an exact state's, at all 200 pixels.

    And within that of the state at the very parameters shown, but close to folds, where states
    change like the root of the parameters.
    """
    picked = arch_page(PICKED, 7)
    cells = arch_set.cells[[each["cell"] for each in picked]]
    drawn = np.reshape([each["shape"] for each in picked], (POINTS, -1, 2))
    places = np.concatenate([arch_set.points.z, arch_set.coordinates], axis=1)[cells]
    exact, sides = _Exact(arch_set, POINTS), places[:, 1:] - places[:, :1]
    middle = np.einsum("nk,nkj->nj", [each["weights"] for each in picked], places)
    start, found = exact.newton(middle, sides / np.linalg.norm(sides, axis=2, keepdims=True))
    assert found.all()
    near = exact.nearest(start, drawn)
    apart = np.linalg.norm(exact.shape(near) - drawn, axis=2).max(axis=1)
    assert apart.max() <= NEAR, np.quantile(apart, [0.5, 0.9, 0.99, 1.0])
    same, found = exact.at(near, [each["p"] for each in picked])
    apart = np.linalg.norm(exact.shape(same) - drawn, axis=2).max(axis=1)
    assert (found & (apart <= NEAR)).mean() >= MOST


def test_the_page_of_the_arch_is_small_and_quick(arch_page):
    """At most 4 MB; a pick and all that follows take 50 ms, the least of 30 on a busy machine."""
    assert arch_page.size <= 4e6
    assert arch_page(CPU) <= 50.0


def test_a_hundred_thousand_vertices_fit_into_one_page(browser, tmp_path):
    """At most 16 MB; picks still take 50 ms."""
    spring = em.Spring()
    box = em.Box(x_l=(0.4, 1.4), F=(-0.3, 0.3))
    eset = em.equilibrium_set(spring, box, intervals=(280, 280), checks=0)
    assert len(eset.points) > 1e5
    path = em.explore(eset, None, tmp_path / "large.html", snaps=em.SnapGraph(eset, (), ()))
    assert path.stat().st_size <= 16e6
    start = time.perf_counter()
    page = Opened(browser, path)
    assert time.perf_counter() - start < 60.0
    assert page("explorer.set.vertices") == len(eset.points)
    assert page(CPU) <= 50.0
    page.context.close()
