"""Are there equilibria that a set lacks? Ask an independent search, and lift what it finds.

What is missing becomes equilibria over the vertices of the grid.

See docs/decisions.md, "Checks are also the last seeds".
"""

from dataclasses import dataclass, field

import numpy as np

from equimorph.arrays import Float, Int, Lanes, Places
from equimorph.equilibria import Completeness, search_points
from equimorph.equilibria.random_search import Ground, Pools
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.setting import Setting
from equimorph.manifold.geometry.simplices import volumes
from equimorph.manifold.lifting.descents_of_set import descents_of_set, spread_over_strata
from equimorph.manifold.lifting.grid import bisect, split_at
from equimorph.manifold.lifting.hidden_islands import IslandFinder
from equimorph.manifold.lifting.pairing import Pairing
from equimorph.manifold.lifting.parted_pieces import between_pieces
from equimorph.manifold.lifting.scattered import PER_FREE, Scattered, push_on, scatter
from equimorph.manifold.lifting.seeds import Seeds, polish
from equimorph.manifold.lifting.states_in_sides import are_grazing, states_in_sides
from equimorph.manifold.lookup.exact_states import exact_states, lift_to
from equimorph.model import Progress, are_feasible
from equimorph.structures import States, join_states

STARTS = 200
"""Random starts of Newton's method in each independent search."""
FIRST, FIRST_OF = 2, 4
"""Points that are searched first: at least so many, and one in so many of all. Alone, one point
takes three quarters of the time of two."""
SCATTERED = 2000
"""Random points with one random guess each, from which Newton starts in addition to searches."""
PUSHED = 300
"""Guesses that are pushed on in sets that lacked nothing, at most."""
RUNGS, LINES = 40, 3
"""Times that lines are laid through states that lines met and the set lacks, at most; lines through
each."""


@dataclass(frozen=True)
class Check:
    """How many equilibria a search found, and those of them that the set lacks.

    descents: how many descents from unstable strata ended how; what they landed on is among those
    that were found. on_lines: states that lines through the strata met. left_out: states that the
    set lacks, and the discretisation does not resolve. grazing: points of sides in which sheets
    end that lie beyond the box. starts, arrived: random guesses of the searches, and those that led
    to a state.
    """

    found: int
    missing: States
    descents: tuple[tuple[str, int], ...] = ()
    on_lines: int = 0
    left_out: int = 0
    grazing: Places = field(default_factory=lambda: np.zeros((0, 0)))
    starts: int = 0
    arrived: int = 0

    def joined(self, other: "Check") -> "Check":
        """With what was found in addition."""
        return Check(
            self.found + other.found,
            join_states(self.missing.structure, [self.missing, other.missing]),
            self.descents + other.descents,
            self.on_lines + other.on_lines,
            self.left_out + other.left_out,
            other.grazing if len(other.grazing) else self.grazing,
            self.starts + other.starts,
            self.arrived + other.arrived,
        )


def check(
    eset: EquilibriumSet,
    generator: np.random.Generator,
    points: int,
    islands: IslandFinder,
    progress: Progress,
    *,
    lacked: bool = False,
) -> Check:
    """Search at random points, half of them anywhere in the box, half below the set.

    Thoroughly at `points`, and from one guess each at `SCATTERED` others: so pieces over a small
    part of the box are seen, too. If something is missing at the first points or elsewhere, the
    other points wait, and so do guesses that are pushed on: the set that is lifted from it is
    checked again. So the last check has searched everywhere, unless it says what is missing. A set
    that `lacked` something may lack more: all guesses are pushed on.
    """
    progress.report("independent checks", 0, points)
    chosen = [
        np.asarray(generator.uniform(eset.box.lower, eset.box.upper))
        if number % 2 == 1 or len(eset.cells) == 0
        else _below(eset, generator)
        for number in range(points)
    ]
    places = [dict(zip(eset.names, point.tolist(), strict=True)) for point in chosen]
    if not places:
        return Check(0, eset.points[:0])
    seed, first = int(generator.integers(2**31)), max(FIRST, points // FIRST_OF)
    scattered = scatter(eset, SCATTERED, np.random.default_rng(seed))
    found = _searched(eset, places[:first], seed)
    found = found.joined(_elsewhere(eset, scattered, seed, islands))
    if len(found.missing):
        return found
    pushed = push_on(eset, scattered.arrivals, SCATTERED if lacked else PUSHED)
    found = found.joined(_led_to(eset, pushed))
    if len(found.missing) or len(places) <= first:
        return found
    progress.report("independent checks", first, points)
    return found.joined(_searched(eset, places[first:], seed + 1))


def _searched(eset: EquilibriumSet, places: list[dict[str, float]], seed: int) -> Check:
    """What searches find at some points, beside what the set has there."""
    points = np.stack([eset.parameters_at(at) for at in places])
    searched = search_points(
        eset.structure,
        points,
        within=eset.constraints,
        starts=STARTS,
        runs=1,
        seed=seed,
        known=eset.sheets.over(points)[0],
    )
    found = join_states(eset.structure, searched)
    dropped = [each.unresolved for each in searched if each.unresolved is not None]
    starts, arrived = (
        sum(getattr(each.completeness, name) for each in searched) for name in ("starts", "arrived")
    )
    left_out = len(_left_out(eset, join_states(eset.structure, dropped)))
    lacking = _lacking(found, eset)
    met = sum(_met(each.completeness) for each in searched)
    return Check(met, lacking, left_out=left_out, starts=starts, arrived=arrived)


def _led_to(eset: EquilibriumSet, states: States) -> Check:
    """What guesses led to."""
    resolved = states.resolved
    found = states[np.flatnonzero(resolved)]
    left_out = len(_left_out(eset, states[np.flatnonzero(~resolved)]))
    return Check(len(found), _lacking(found, eset), left_out=left_out)


def _elsewhere(
    eset: EquilibriumSet, scattered: Scattered, seed: int, islands: IslandFinder
) -> Check:
    """What guesses over their own points, sides, descents, lines and images lead to."""
    led_to = _led_to(eset, scattered.found)
    in_sides, grazing = _in_sides(eset, np.random.default_rng(seed))
    led, pools = descents_of_set(eset), _on_lines(eset, np.random.default_rng(seed))
    begun = len(pools.ground.p)
    met = _within(pools, pools.z[begun:], pools.group[begun:])
    structure = eset.structure
    beside = _belonging(eset, join_states(structure, [islands.find(eset), _mirrored(eset)]))
    told = (led.landed, met, beside)
    entering = in_sides[np.flatnonzero(in_sides.resolved)]
    parted = between_pieces(eset)
    lacking = join_states(structure, [*(_lacking(each, eset) for each in told), entering, parted])
    dropped = [_within(pools, *each) for each in pools.unresolved]
    dropped.append(in_sides[np.flatnonzero(~in_sides.resolved)])
    left_out = len(_left_out(eset, join_states(structure, dropped)))
    return led_to.joined(Check(0, lacking, led.outcomes, len(met), left_out, grazing))


def _left_out(eset: EquilibriumSet, dropped: States) -> States:
    """Those of the states that are not resolved which belong to what is asked for, and lack."""
    good = eset.structure.may_resolve(dropped.z, dropped.p)
    good &= are_feasible(eset.constraints, dropped.z, dropped.p)
    return _lacking(dropped[np.flatnonzero(good)], eset)


def _met(told: Completeness) -> int:
    """Number of states that were found without being known."""
    return int((~told.captured[0] | told.captured[1:].any(axis=0)).sum())


def _in_sides(eset: EquilibriumSet, generator: np.random.Generator) -> tuple[States, Places]:
    """States in sides that a set lacks, and one place of those in each that are only folds."""
    found = _lacking(states_in_sides(eset, SCATTERED // PER_FREE, generator), eset)
    only = are_grazing(found)
    places = found.p[only][:, eset.setting.free]
    held = (places == eset.box.lower) * 1 + (places == eset.box.upper) * 2
    _, first = np.unique(held, axis=0, return_index=True)
    return found[np.flatnonzero(~only)], places[first]


def _on_lines(eset: EquilibriumSet, generator: np.random.Generator) -> Pools:
    """Vertices of all strata, and what random lines through them meet over the same points.

    Lines in all actuators and loads are followed both ways through folds, beyond the box: sheets
    that hang together there and are narrow inside it are met from those beside them. Each leads to
    the next one, so that lines begin at what the set lacks, too, until they meet nothing new.

    See docs/decisions.md, "Sheets in a corner are climbed like a ladder".
    """
    anywhere = range(eset.structure.size + 1)
    vertices = [own for _, own in spread_over_strata(eset, anywhere)]
    chosen = np.concatenate([np.zeros(0, int), *vertices])
    lanes, states = np.arange(len(chosen)), eset.points[chosen]
    pools = Pools(Ground(eset.structure, states.p, eset.constraints), generator, states.z, lanes)
    known = len(lanes)
    pools.lay_lines(lanes)
    for _ in range(RUNGS):
        z, group = pools.z[known:], pools.group[known:]
        good = np.flatnonzero(pools.ground.excess(z, group) <= 0.0)
        met = States(eset.structure, z[good], pools.ground.p[group[good]])
        new = known + good[_are_lacking(met, eset)]
        if len(new) == 0:
            break
        known = len(pools.z)
        pools.lay_lines(np.repeat(new, LINES))
    return pools


def _within(pools: Pools, z: Lanes, group: Int[np.ndarray, " lanes"]) -> States:
    """Those of the states over points of some pools that obey the constraints."""
    good = pools.ground.excess(z, group) <= 0.0
    return States(pools.ground.structure, z[good], pools.ground.p[group[good]])


def _mirrored(eset: EquilibriumSet) -> States:
    """Mirror images of a state on the largest cell of each stratum.

    Pieces in corners of the box are hardly met.
    """
    structure, size = eset.structure, np.abs(volumes(eset.coordinates[eset.cells]))
    order = np.lexsort((-size, eset.stratum))
    largest = order[np.unique(eset.stratum[order], return_index=True)[1]]
    p, guess = (each[eset.cells[largest]].mean(axis=1) for each in (eset.points.p, eset.points.z))
    z, found, index = exact_states(structure, guess, p, eset.cell_index[largest])
    good = found & (index == eset.cell_index[largest])
    return join_states(structure, _images(eset.setting, States(structure, z[good], p[good])))


def _belonging(eset: EquilibriumSet, states: States) -> States:
    """Those of the states that are resolved and over the box, within the constraints."""
    good = states.resolved & eset.box.holds(states.p[:, eset.setting.free])
    good &= are_feasible(eset.constraints, states.z, states.p)
    return states[np.flatnonzero(good)]


def _lacking(found: States, eset: EquilibriumSet) -> States:
    """Those of the states, each over its own point, that a set lacks; see `_are_lacking`."""
    back = States(eset.structure, eset.structure.whole_turns.taken_back(found.z), found.p)
    return back[_are_lacking(back, eset)]


def _are_lacking(states: States, eset: EquilibriumSet) -> Int[np.ndarray, " some"]:
    """Places of those of some states that a set lacks; copies of them will do."""
    lacking = np.flatnonzero(~eset.holding(states)[0])
    turns = eset.structure.whole_turns.free
    for turn in (*turns, *-turns):
        if len(lacking):
            turned = States(eset.structure, states.z[lacking] + turn, states.p[lacking])
            lacking = lacking[~eset.holding(turned)[0]]
    return lacking


def _below(eset: EquilibriumSet, generator: np.random.Generator) -> Float[np.ndarray, " d"]:
    cell = eset.cells[generator.integers(len(eset.cells))]
    return np.asarray(generator.dirichlet(np.ones(len(cell))) @ eset.coordinates[cell])


def seeds_from(
    setting: Setting, mesh: BaseMesh, missing: States
) -> tuple[Seeds, Int[np.ndarray, " n"]]:
    """Equilibria over the corners of grid cells around states and around their mirror images.

    Returned with them is the number of the state that each comes from.
    """
    states = join_states(setting.structure, [missing, *_images(setting, missing)])
    cells = np.array([mesh.locate(point) for point in states.p[:, setting.free]], dtype=int)
    vertices = mesh.cells[cells]
    origin = np.repeat(np.arange(len(states)), vertices.shape[1])
    targets = setting.parameters(mesh.vertices[vertices.ravel()])
    z, which = lift_to(states[origin], targets, setting.constraints)
    found, good = polish(setting, mesh, vertices.ravel()[which], z)
    return found, origin[which][good]


def _images(setting: Setting, states: States) -> list[States]:
    """Mirror images at the same values of the parameters that are not free."""
    images = []
    for symmetry in setting.structure.symmetries():
        z, p = symmetry.apply(states.z, states.p)
        kept = (np.delete(p - setting.base, setting.free, axis=1) == 0.0).all(axis=1)
        images.append(States(states.structure, z[kept], p[kept]))
    return images


HIDDEN = 12
"""Rounds of bisection around missing states that bring no new equilibria over grid vertices."""


def recover(pairing: Pairing, missing: States) -> None:
    """Enter equilibria over the corners of grid cells around states that were missing.

    Cells are split at the places of the states where that brings nothing new: no corner lies below
    the piece of the set, or its straight cells leave out the states, which are close to a curved
    fold. After as many splits as there are parameters a vertex of the grid lies below a state. Each
    cell is split for one of them: what that vertex brings may be what the others belong to.
    """
    for _ in range(HIDDEN):
        if pairing.is_full:
            return
        known, mesh = pairing.points.count, pairing.mesh
        found, origin = seeds_from(pairing.setting, mesh, missing)
        ids, _ = pairing.points.over_vertices(*found)
        missing = missing[np.setdiff1d(np.arange(len(missing)), origin[ids >= known])]
        if len(missing) == 0:
            return
        places = missing.p[:, pairing.setting.free]
        _, first = np.unique([mesh.locate(place) for place in places], return_index=True)
        shares = dict(split_at(mesh, place) for place in places[first])
        pairing.fit()
        pairing.use_mesh(bisect(mesh, np.array(list(shares), int), shares))
