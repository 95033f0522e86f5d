"""Random knocks along two routes: one planned for barriers, one for the stability margin.

    python benchmarks/knocks.py [NUMBER] [SHARE]

Each knock meets a state at a random place of a route, at rest, and gives it a kinetic energy of
SHARE times the larger one of the least barriers of both routes, in a random direction of its six
lowest modes. The structure's own equations of motion tell whether it comes back.
"""

import sys

import numpy as np

import equimorph as em
from equimorph.dynamics.outcomes import Clock, Launches, Outcome, play
from equimorph.dynamics.own import OwnModel
from equimorph.structures.vibration import vibrations

MODES, DAMPING, STEP, TOGETHER = 6, 0.05, 0.04, 100


def knock(field, states, energy, number, generator):
    """Share of knocks after which states land elsewhere, and of those that stay undecided."""
    structure, way = states.structure, np.linspace(0.0, 1.0, len(states))
    place = np.searchsorted(way, generator.uniform(0.0, 1.0, number))
    model = OwnModel(structure, states[0])
    clock = Clock(STEP * model.unit, DAMPING * model.unit * model.frequency**2, model.unit)
    barriers = field.of(states).energy / structure.energy_scale
    level = structure.energy(states.z, states.p) + barriers
    count = min(MODES, structure.unknowns - structure.constraints)
    modes = vibrations(structure, states.z, states.p, count).modes
    left = undecided = 0
    for first in range(0, number, TOGETHER):
        own = place[first : first + TOGETHER]
        aim = generator.normal(size=(len(own), count))
        aim *= np.sqrt(2.0 * energy / (aim**2).sum(axis=1))[:, None]
        able = np.flatnonzero(energy > barriers[own])
        velocity = np.einsum("lk,lku->lu", aim, modes[own])[able]
        own = own[able]
        if len(own) == 0:
            continue
        given = Launches(states.z[own], states.p[own], velocity, states.z[own], level[own])
        code = play(structure, given, clock, watch=False).code
        left += int(np.isin(code, (Outcome.LEFT, Outcome.ESCAPED)).sum())
        undecided += int(np.isin(code, (Outcome.OPEN, Outcome.LOST)).sum())
    return left / number, undecided / number


def cases():
    """Name, set, start and goal."""
    arch = em.Rod()
    box = em.Box(Theta=(0.6, 1.6), Delta=(-1.4, 1.4))
    eset = em.equilibrium_set(arch, box, fixed={"q": 2.5}, intervals=(20, 40))
    here = sorted(eset.at(Theta=1.0, Delta=0.0).stable, key=arch.elevation)
    yield "arch", eset, here[-1], here[0]
    spring = em.Spring()
    eset = em.equilibrium_set(spring, em.Box(x_l=(0.6, 1.3), F=(-0.1, 0.1)), intervals=(28, 20))
    here = sorted(eset.at(x_l=0.8, F=0.01).stable, key=spring.elevation)
    yield "spring", eset, here[-1], here[0]


def main(number=1000, share=1.0):
    """Print one line per case and route."""
    for name, eset, start, goal in cases():
        field = em.barriers(eset)
        margin = em.Descriptor(
            "margin", "1", lambda z, p, s=eset.structure: em.States(s, z, p).margin
        )
        routes = {
            "barrier": em.plan(eset, start, goal, objective=field.descriptor),
            "margin": em.plan(eset, start, goal, objective=margin),
        }
        known = {kind: field.of(route.states).energy for kind, route in routes.items()}
        least = {kind: float(np.nanmin(values)) for kind, values in known.items()}
        energy = share * max(least.values())
        for kind, route in routes.items():
            generator = np.random.default_rng(0)
            scale = eset.structure.energy_scale
            gone, open_ = knock(field, route.states, energy / scale, number, generator)
            sys.stdout.write(
                f"{name}, planned for {kind}: length {route.length:.3f}, least barrier "
                f"{least[kind]:.5f}, least margin {route.states.margin.min():.4f}; energy "
                f"{energy:.5f}: {gone:.2%} snap, {open_:.2%} undecided\n"
            )


if __name__ == "__main__":
    main(*(kind(text) for kind, text in zip((int, float), sys.argv[1:], strict=False)))
