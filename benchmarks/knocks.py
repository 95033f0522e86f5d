"""Random knocks along routes planned for barriers, for the stability margin, and for length.

    python benchmarks/knocks.py [arch|strip|truss|spring] [NUMBER] [SHARE]

Each knock meets a state at a random place of a route, at rest, and gives it a kinetic energy of
SHARE times the larger one of the least barriers of the first two, in a random direction of its six
lowest modes. The structure's own equations of motion tell whether it comes back.
"""

import sys

import numpy as np

import equimorph as em
from equimorph.dynamics.outcomes import Clock, Launches, Outcome, play
from equimorph.dynamics.own_equations import OwnModel
from equimorph.structures.vibration import vibrations

MODES, DAMPING, STEP, TOGETHER = 6, 0.05, 0.04, 200


def knock(field, states, energy, number, generator):
    """Share of knocks after which states land elsewhere, and of those that stay undecided."""
    structure, way = states.structure, np.linspace(0.0, 1.0, len(states))
    place = np.searchsorted(way, generator.uniform(0.0, 1.0, number))
    model = OwnModel(structure, states[0])
    barriers = field.of(states).energy / structure.energy_scale
    level = structure.energy(states.z, states.p) + barriers
    count = min(MODES, structure.unknowns - structure.constraints)
    free = vibrations(structure, states.z, states.p, count)
    rate = DAMPING * model.unit * model.frequency**2
    clock = Clock.resolving(free.frequencies.ravel(), STEP * model.unit, rate, model.unit)
    left = undecided = 0
    for first in range(0, number, TOGETHER):
        own = place[first : first + TOGETHER]
        aim = generator.normal(size=(len(own), count))
        aim *= np.sqrt(2.0 * energy / (aim**2).sum(axis=1))[:, None]
        able = np.flatnonzero(energy > barriers[own])
        velocity = np.einsum("lk,lku->lu", aim, free.modes[own])[able]
        own = own[able]
        if len(own) == 0:
            continue
        given = Launches(states.z[own], states.p[own], velocity, states.z[own], level[own])
        code = play(structure, given, clock, watch=False).code
        left += int(np.isin(code, (Outcome.LEFT, Outcome.ESCAPED)).sum())
        undecided += int(np.isin(code, (Outcome.OPEN, Outcome.LOST)).sum())
    return left / number, undecided / number


def arch():
    """The arch under its load: set, place of start and goal, upright first."""
    made = em.Rod()
    box = em.Box(Theta=(0.6, 1.6), Delta=(-1.4, 1.4))
    eset = em.equilibrium_set(made, box, fixed={"q": 2.5}, intervals=(20, 40))
    return eset, {"Theta": 1.0, "Delta": 0.0}


def strip():
    """The strip without loads, ν = 0.95."""
    rod = em.Rod(span=0.95)
    box, within = em.Box(Theta=(-1, 1), Delta=(-1, 1)), [rod.max_curvature <= 12]
    eset = em.equilibrium_set(rod, box, fixed={"q": 0.0}, within=within, intervals=(13, 13))
    return eset, {"Theta": 0.2, "Delta": 0.1}


def truss():
    """The von Mises truss whose bars change their lengths."""
    made = em.Truss(
        {"A": (-1.0, 0.0), "B": (0.0, 0.3), "C": (1.0, 0.0)},
        [("A", "B"), ("B", "C")],
        {"A": "xy", "C": "xy"},
        {"F": {"B": (0.0, -1.0)}},
        {"a": {"A-B": 1.0, "B-C": 1.0}},
        masses={"B": 1.0},
    )
    eset = em.equilibrium_set(made, em.Box(a=(-0.1, 0.03), F=(-0.02, 0.02)), intervals=(26, 26))
    return eset, {"a": 0.02, "F": 0.001}


def spring():
    """The spring between guides."""
    box = em.Box(x_l=(0.6, 1.3), F=(-0.1, 0.1))
    return em.equilibrium_set(em.Spring(), box, intervals=(28, 20)), {"x_l": 0.8, "F": 0.01}


def main(name="truss", number=1000, share=1.0):
    """Print one line per route."""
    eset, place = {"arch": arch, "strip": strip, "truss": truss, "spring": spring}[name]()
    goal, *_, start = sorted(eset.at(**place).stable, key=eset.structure.elevation)
    field = em.barriers(eset)
    margin = em.Descriptor("margin", "1", lambda z, p, s=eset.structure: em.States(s, z, p).margin)
    objectives = {"barrier": field.descriptor, "margin": margin, "length": "length"}
    routes = {kind: em.plan(eset, start, goal, objective=each) for kind, each in objectives.items()}
    known = {kind: field.of(route.states).energy for kind, route in routes.items()}
    least = {kind: float(np.nanmin(values)) for kind, values in known.items()}
    energy = share * max(least["barrier"], least["margin"])
    for kind, route in routes.items():
        generator, scale = np.random.default_rng(0), eset.structure.energy_scale
        gone, open_ = knock(field, route.states, energy / scale, number, generator)
        sys.stdout.write(
            f"{name}, planned for {kind}: length {route.length:.3f}, least barrier "
            f"{least[kind]:.5f}, least margin {route.states.margin.min():.4f}; energy "
            f"{energy:.5f}: {gone:.2%} snap, {open_:.2%} undecided\n"
        )


if __name__ == "__main__":
    main(*(kind(text) for kind, text in zip((str, int, float), sys.argv[1:], strict=False)))
