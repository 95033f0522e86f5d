"""Random routes with boxes of errors: how wide they are proved, and trials inside that must arrive.

The true width is that of the trials in corners, middles of sides and random points of the sides.

Run it: python benchmarks/survival.py [arch|strip|truss] [routes] [trials]
"""

import sys
import time
import warnings

import numpy as np

import equimorph as em
from equimorph.tasks.robustness.survival import Question

SHARES = (0.7, 0.5, 0.35, 0.2, 0.1)
"""Parts of the true widths that are tried to be proved, from the middle one on."""
MARGIN = 0.1
"""Least margin of the routes, relative to the largest of the ends'."""


def arch() -> tuple[em.EquilibriumSet, dict[str, float]]:
    """The arch at q = 2.5, with errors of a motor and of the load."""
    rod = em.Rod()
    box, within = em.Box(Theta=(0.2, 2.5), Delta=(-2, 2)), [rod.max_curvature <= 20]
    eset = em.equilibrium_set(rod, box, fixed={"q": 2.5}, within=within, intervals=(12, 21))
    return eset, {"Theta": 0.01, "q": 0.01}


def strip() -> tuple[em.EquilibriumSet, dict[str, float]]:
    """The strip without loads, ν = 0.95, with errors of both motors."""
    rod = em.Rod(span=0.95)
    box, within = em.Box(Theta=(-1, 1), Delta=(-1, 1)), [rod.max_curvature <= 12]
    eset = em.equilibrium_set(rod, box, fixed={"q": 0.0}, within=within, intervals=(13, 13))
    return eset, {"Theta": 0.01, "Delta": 0.01}


def truss() -> tuple[em.EquilibriumSet, dict[str, float]]:
    """The von Mises truss whose bars change their lengths."""
    made = em.Truss(
        {"A": (-1.0, 0.0), "B": (0.0, 0.3), "C": (1.0, 0.0)},
        [em.Bar(ends, EA=1.0) for ends in (("A", "B"), ("B", "C"))],
        {"A": "xy", "C": "xy"},
        {"F": {"B": (0.0, -1.0)}},
        {"a": {"A-B": 1.0, "B-C": 1.0}},
    )
    eset = em.equilibrium_set(made, em.Box(a=(-0.1, 0.03), F=(-0.02, 0.02)), intervals=(26, 26))
    return eset, {"a": 0.001, "F": 0.001}


def random_route(eset: em.EquilibriumSet, rng: np.random.Generator) -> em.Route:
    """Route between random stable states."""
    stable = eset.points[np.flatnonzero((eset.index == 0) & (eset.kinds == 0))]
    while True:
        start, goal = (stable[int(k)] for k in rng.integers(len(stable), size=2))
        route = em.plan(eset, start, goal, margin=MARGIN * max(start.margin, goal.margin))
        if route.arrived:
            return route


def proved_share(asked: Question, width: float) -> float:
    """Largest of the shares of a width that is proved, 0 if none is."""
    half = SHARES.index(0.5)
    order = SHARES[: half + 1][::-1] if asked.proves(0.5 * width) else SHARES[half + 1 :]
    best = 0.0
    for share in order:
        good = share == 0.5 or asked.proves(share * width)  # tried before
        if good:
            best = share
        if good == (share < 0.5):
            break
    return best


def main(name: str = "arch", routes: int = 20, trials: int = 2000) -> None:
    """Print the width of each route, true and proved, and the failures inside."""
    warnings.simplefilter("ignore")
    eset, sizes = {"arch": arch, "strip": strip, "truss": truss}[name]()
    rng, shares, failures, begin = np.random.default_rng(4), [], 0, time.process_time()
    for number in range(routes):
        route = random_route(eset, rng)
        assert route.states is not None
        asked = Question.of(route.states[0], route.schedule, sizes, ())
        width, is_open = asked.room()
        share = proved_share(asked, width)
        box = asked.scaled(max(share * width, 1e-12))
        inside = rng.uniform(-1.0, 1.0, (trials, len(sizes))) * box.errors.widths
        failed = int((box.execute(inside).kind != "arrived").sum())
        shares, failures = [*shares, share], failures + failed * (share > 0.0)
        words = f"{number} margin {route.margin:.4g}, true {width:.4g}{' (open)' * is_open}"
        took = time.process_time() - begin
        sys.stdout.write(f"{words}, proved {share}, {failed} of {trials} fail, {took:.0f} s\n")
        sys.stdout.flush()
    sys.stdout.write(
        f"{name}: {failures} of {routes * trials} trials fail in proved boxes; proved shares "
        f"median {np.median(shares)}, least {min(shares)}\n"
    )


if __name__ == "__main__":
    main(*sys.argv[1:2], *map(int, sys.argv[2:4]))
