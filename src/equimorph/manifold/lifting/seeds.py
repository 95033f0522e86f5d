"""First equilibria over a few grid vertices, from which the set is flooded."""

import numpy as np

from equimorph.arrays import Bool, Float, Int, Items, Places, Some
from equimorph.equilibria import Guards, ParameterLine, TraceOptions, search_points, settle
from equimorph.equilibria.trace import trace
from equimorph.equilibria.trace_options import EventCode
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.geometry.setting import Setting
from equimorph.marching.kernels import MULTIPLIER_WEIGHT
from equimorph.model import are_feasible, position

COARSE = 5
"""Approximate number of vertices along each parameter at which natural states are lifted."""
SEARCHED = 3
"""Vertices, in addition to the middle one, at which a random search looks for equilibria that no
natural path reaches."""
MORE = 12
"""The same in diagrams over one parameter and in symmetric slices: their pieces are less often
connected."""
STARTS = 100
"""Random guesses over each of them."""
EXACT = Guards(iterations=1, longest=np.inf, converged=1e-8, multipliers=MULTIPLIER_WEIGHT)
"""Equilibria need one correction at most, which squares what is left."""

Seeds = tuple[
    Items,
    Float[np.ndarray, "n size"],
    Float[np.ndarray, "n P"],
    Items,
]


def seeds(setting: Setting, mesh: BaseMesh, searchable: Some, seed: int) -> Seeds:
    """Vertices, unknowns, parameters and index of first equilibria; deterministic for a `seed`.

    Random search is restricted to the `searchable` vertices.
    """
    vertices, z = _from_natural_states(setting, *_spread(mesh))
    searched_v, searched_z = _from_search(setting, mesh, searchable, seed)
    vertices, z = np.concatenate([vertices, searched_v]), np.concatenate([z, searched_z])
    good = setting.structure.resolved(z, setting.parameters(mesh.vertices[vertices]))
    return polish(setting, mesh, vertices[good], z[good])[0]


def polish(
    setting: Setting, mesh: BaseMesh, vertices: Some, z: Float[np.ndarray, "some size"]
) -> tuple[Seeds, Bool[np.ndarray, " some"]]:
    """Those of the states over vertices that are equilibria, polished; and which.

    Curves of the set lead to them: so they belong to it, whether or not they are resolved.
    """
    p = setting.parameters(mesh.vertices[vertices])
    settled = settle(setting.structure, z, p, guards=EXACT)
    good = settled.found
    good[good] = are_feasible(setting.constraints, settled.z[good], p[good])
    return (vertices[good], settled.z[good], p[good], settled.index[good]), good


def _spread(mesh: BaseMesh) -> tuple[Items, Places]:
    """About `COARSE` vertices along each parameter, off the lines of symmetry of the box."""
    low, high = mesh.vertices.min(axis=0), mesh.vertices.max(axis=0)
    share = (np.arange(COARSE) + 0.5) / COARSE
    lines = np.meshgrid(*[share] * mesh.dimension, indexing="ij")
    grid = np.stack(lines, axis=-1).reshape(-1, mesh.dimension)
    wanted = low + grid * (high - low)
    nearest = [(((mesh.vertices - w) / (high - low)) ** 2).sum(axis=1).argmin() for w in wanted]
    chosen = np.unique(nearest)
    return chosen, mesh.vertices[chosen]


def _from_natural_states(
    setting: Setting, vertices: Items, points: Places
) -> tuple[Int[np.ndarray, " m"], Float[np.ndarray, "m size"]]:
    structure = setting.structure
    p = setting.parameters(points)
    unloaded = p.copy()
    for name, value in structure.unloaded().items():
        unloaded[:, position(structure.parameters, name)] = value
    z, found = structure.natural(unloaded)
    z, p, unloaded, vertices = z[found], p[found], unloaded[found], vertices[found]
    moving = np.abs(p - unloaded).max(axis=1) > 0
    line = ParameterLine(structure, unloaded[moving], (p - unloaded)[moving])
    options = TraceOptions(
        through_folds=True, through_branch_points=True, record=False, locate_passed=False
    )
    outcome = trace(line, z[moving], setting.constraints, options)
    arrived = outcome.code == EventCode.ARRIVED
    return (
        np.concatenate([vertices[~moving], vertices[moving][arrived]]),
        np.concatenate([z[~moving], outcome.z[arrived]]),
    )


def _from_search(
    setting: Setting, mesh: BaseMesh, searchable: Some, seed: int
) -> tuple[Int[np.ndarray, " m"], Float[np.ndarray, "m size"]]:
    generator = np.random.default_rng(seed)
    away = (mesh.vertices[searchable] - mesh.vertices[searchable].mean(axis=0)) / setting.scales
    middle = searchable[(away**2).sum(axis=1).argmin()]
    many = len(setting.free) == 1 or is_symmetric(setting)
    chosen = np.unique([middle, *generator.choice(searchable, MORE if many else SEARCHED)])
    found = search_points(
        setting.structure,
        setting.parameters(mesh.vertices[chosen]),
        within=setting.constraints,
        starts=STARTS,
        seed=seed,
    )
    vertices = np.repeat(chosen, [len(states) for states in found])
    return vertices, np.concatenate([states.z for states in found])


def is_symmetric(setting: Setting) -> bool:
    """Whether a symmetry of the structure leaves all parameters in the box where they are.

    Those along orbits do not count: every state is one of two opposite ones of its orbit, so that
    no sheet is its own image, but on an axis, and no pieces come apart at such sheets.
    """
    inside = setting.base.copy()
    inside[setting.free] = np.sqrt(np.arange(2.0, 2.0 + len(setting.free)))  # no number twice
    return any(
        np.array_equal(symmetry.image(inside), inside)
        for symmetry in setting.structure.symmetries()
        if not symmetry.along_orbits
    )
