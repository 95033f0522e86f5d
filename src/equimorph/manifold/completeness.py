"""Are there equilibria that a set lacks? Ask an independent search, and lift what it finds."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from equimorph.equilibria import search_points
from equimorph.manifold.equilibrium_set import EquilibriumSet
from equimorph.manifold.mesh import BaseMesh
from equimorph.manifold.over import lift_to
from equimorph.manifold.pairing import Setting
from equimorph.manifold.seeds import Seeds, polished
from equimorph.model import Findings, Journal, Progress, recalled, step_of
from equimorph.structures import States

APART = 1e-5
"""Distance in the metric above which two equilibria are two."""
STARTS = 200


@dataclass(frozen=True)
class Check:
    """How many equilibria a search found, and those of them that the set lacks."""

    found: int
    missing: tuple[States, ...]

    @property
    def lacking(self) -> int:
        """Number of missing equilibria."""
        return sum(len(states) for states in self.missing)


def check(
    eset: EquilibriumSet,
    generator: np.random.Generator,
    points: int,
    progress: Progress,
    journal: Journal,
) -> Check:
    """Search at random points, half of them anywhere in the box, half below the set."""
    progress.report("independent checks", 0, points)
    chosen = [
        _in_the_box(eset, generator)
        if number % 2 == 1 or len(eset.cells) == 0
        else _below(eset, generator)
        for number in range(points)
    ]
    places = [dict(zip(eset.names, point.tolist(), strict=True)) for point in chosen]
    if not places:
        return Check(0, ())
    seed = int(generator.integers(2**31))
    step = step_of("check", np.stack(chosen))
    found, sizes, z, p = recalled(journal, step, lambda: _missing(eset, places, seed))
    bounds = np.cumsum(sizes)[:-1]
    parts = zip(np.split(z, bounds), np.split(p, bounds), strict=True)
    missing = tuple(States(eset.structure, *part) for part in parts if len(part[0]))
    return Check(int(found), missing)


def _missing(eset: EquilibriumSet, places: list[dict[str, float]], seed: int) -> Findings:
    """How many equilibria a search finds, how many of each place the set lacks, and these."""
    found = search_points(
        eset.structure,
        np.stack([eset.parameters_at(at) for at in places]),
        within=eset.constraints,
        starts=STARTS,
        seed=seed,
    )
    lacking = [_lacking(states, eset.at(**at)) for states, at in zip(found, places, strict=True)]
    return (
        np.array(sum(map(len, found))),
        np.array([len(states) for states in lacking]),
        np.concatenate([states.z for states in lacking]),
        np.concatenate([states.p for states in lacking]),
    )


def _below(eset: EquilibriumSet, generator: np.random.Generator) -> Float[np.ndarray, " d"]:
    cell = eset.cells[generator.integers(len(eset.cells))]
    return np.asarray(generator.dirichlet(np.ones(len(cell))) @ eset.coordinates[cell])


def _in_the_box(eset: EquilibriumSet, generator: np.random.Generator) -> Float[np.ndarray, " d"]:
    return np.asarray(generator.uniform(eset.box.lower, eset.box.upper))


def _lacking(found: States, known: States) -> States:
    if len(known) == 0:
        return found
    n, mass = found.structure.unknowns, found.structure.mass
    gap = ((found.z[:, None, :n] - known.z[None, :, :n]) ** 2) @ mass
    return found[np.flatnonzero(np.sqrt(gap.min(axis=1)) > APART)]


def seeds_from(setting: Setting, mesh: BaseMesh, missing: tuple[States, ...]) -> Seeds:
    """Equilibria over the corners of grid cells around states and around their mirror images."""
    vertices, z = [np.zeros(0, int)], [np.zeros((0, setting.structure.size))]
    for states in missing:
        for image in (states, *_images(setting, states)):
            for vertex in mesh.cells[mesh.locate(image.p[0, setting.free])]:
                there = setting.parameters(mesh.vertices[[vertex]])
                lifted, _ = lift_to(image, there.repeat(len(image), axis=0), setting.constraints)
                vertices.append(np.full(len(lifted), vertex))
                z.append(lifted)
    return polished(setting, mesh, np.concatenate(vertices), np.concatenate(z))


def _images(setting: Setting, states: States) -> list[States]:
    """Mirror images at the same values of the parameters that are not free."""
    images = []
    for symmetry in setting.structure.symmetries():
        z, p = symmetry.apply(states.z, states.p)
        fixed = np.delete(p - setting.base, setting.free, axis=1)
        if np.abs(fixed).max(initial=0.0) == 0.0:
            images.append(States(states.structure, z, p))
    return images
