"""Random pairs of states whose routes must cost the same there and back, mirrored, and on a grid.

Four routes join each pair: from start to goal, from goal to start, between the mirror images, and
over a finer grid. A share of the smaller margin of both ends may be demanded of all of them. With
snaps the way back is another question, and not compared.

Run it: python benchmarks/routes.py [arch|spring] [pairs] [share] [price of a snap]
"""

import sys
import time
import warnings

import numpy as np

import equimorph as em

QUESTIONS = ("back", "mirror", "grid")
STATED = 2e-3
"""Relative difference of lengths that `plan` states."""


def arch() -> list[em.EquilibriumSet]:
    """The arch at q = 2.5 on two grids."""
    rod = em.Rod(load="uniform")
    box, within = em.Box(Theta=(0.2, 2.5), Delta=(-2, 2)), [rod.max_curvature <= 20]
    return [
        em.equilibrium_set(rod, box, fixed={"q": 2.5}, within=within, intervals=each, checks=0)
        for each in ((12, 21), (33, 49))
    ]


def spring() -> list[em.EquilibriumSet]:
    """The spring on two grids."""
    box = em.Box(x_l=(0.3, 1.3), F=(-0.5, 0.5))
    return [
        em.equilibrium_set(em.Spring(), box, intervals=each, checks=0)
        for each in ((12, 12), (23, 26))
    ]


def random_state(eset: em.EquilibriumSet, rng: np.random.Generator) -> em.State:
    """A stable state over a random point of the box."""
    while True:
        place = rng.uniform(eset.box.lower, eset.box.upper)
        stable = eset.at(**dict(zip(eset.names, place, strict=True))).stable
        if len(stable):
            return stable[int(rng.integers(len(stable)))]


def mirrored(state: em.State) -> em.State:
    """The mirror image of a state."""
    z, p = state.structure.symmetries()[0].apply(state.z[None], state.p[None])
    return em.State(state.structure, z[0], p[0])


def say(line: str) -> None:
    """Write a line at once."""
    sys.stdout.write(line + "\n")
    sys.stdout.flush()


def main(
    kind: str = "arch", pairs: int = 100, share: float = 0.0, price: float | None = None
) -> np.ndarray:
    """Compare the costs, print how far they differ, and return them."""
    sets = {"arch": arch, "spring": spring}[kind]()
    coarse, fine = sets
    rng, costs = np.random.default_rng(7), np.full((pairs, 4), np.nan)
    found, snaps, spent = np.zeros((pairs, 4), int), np.zeros((pairs, 4), int), 0.0
    for number in range(pairs):
        ends = [random_state(coarse, rng) for _ in range(2)]
        least = share * min(end.margin for end in ends)
        images = [mirrored(end) for end in ends]
        back = ends[::-1] if price is None else ends
        asked = [(coarse, ends), (coarse, back), (coarse, images), (fine, ends)]
        begin = time.process_time()
        routes = [em.plan(eset, *each, margin=least, snap_price=price) for eset, each in asked]
        spent += time.process_time() - begin
        costs[number] = [route.cost for route in routes]
        found[number] = [route.arrived for route in routes]
        snaps[number] = [len(route.snaps) for route in routes]
        if np.ptp(found[number]) or np.ptp(costs[number]) > STATED * costs[number].max():
            places = [{name: round(end[name], 8) for name in coarse.names} for end in ends]
            say(f"{number} {places} {costs[number]} {snaps[number]}")
    joined, apart = found.all(axis=1), np.abs(costs[:, 1:] / costs[:, :1] - 1.0)
    say(f"{joined.sum()} of {pairs} pairs joined, {np.ptp(found, axis=1).sum()} by some only,")
    say(f"{np.ptp(snaps, axis=1).sum()} with other numbers of snaps, {spent:.1f} s of CPU")
    for question, each in zip(QUESTIONS, apart[joined].T, strict=True):
        most = ", ".join(f"{value:.1e}" for value in np.quantile(each, [0.5, 0.9, 1.0]))
        say(f"{question:8}{most} (median, 90 %, all); above {STATED}: {(each > STATED).sum()}")
    return costs


if __name__ == "__main__":
    warnings.simplefilter("ignore")
    given = sys.argv[1:]
    main(*given[:1], *map(int, given[1:2]), *map(float, given[2:]))
