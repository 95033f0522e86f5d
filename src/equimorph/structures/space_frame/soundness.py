"""Whether a frame in space is sound: mechanisms, initial stress, errors of the discretisation."""

from functools import cached_property
from typing import NoReturn

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Flags, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.structures.discrete import STEPS, SURE
from equimorph.structures.network import direction_of_mechanism
from equimorph.structures.newton import newton
from equimorph.structures.rod.discretisation import error_by_refinement
from equimorph.structures.space_frame.fields import SpatialFrameFields
from equimorph.structures.space_frame.mechanics import SpatialFrameMechanics
from equimorph.structures.space_frame.model import SpatialFrameModel
from equimorph.structures.space_frame.patterns import SpatialPatterns
from equimorph.tolerances import SINGULAR

SWEEPS = 4
"""Inverse iterations by which the smallest eigenvalue is estimated."""
NAMED = 6
"""Members that a message names."""
MOVING = 1e-6
"""Displacement in a mechanism that counts as one, where members turn by 1e-3."""


class GrowingModel(SpatialFrameModel):
    """A frame whose initial strains are scaled by a last parameter."""

    @cached_property
    def strains(self) -> Float[np.ndarray, "pieces scalars 3"]:
        """Actuated strains of the cross-sections by parameter."""
        found = super().strains.copy()
        found[:, -1] = 0.0
        return found

    @cached_property
    def elongation(self) -> Float[np.ndarray, "pieces scalars"]:
        """Actuated strain along the pieces by parameter."""
        found = super().elongation.copy()
        found[:, -1] = 0.0
        return found


class GrowingFrame(SpatialFrameMechanics):
    """Mechanics of a frame whose initial stress grows with its last parameter, from 0 to 1."""

    def __init__(self, model: SpatialFrameModel) -> None:
        """Take the initial strains of a frame as one more pattern."""
        given, strains = model.patterns, model.strains[None, :, -1]
        initial = model.elongation[None, :, -1] * model.lengths
        none = {name: np.zeros((1, *each.shape[1:])) for name, each in vars(given).items()}
        last = SpatialPatterns(
            **{**none, "strains": strains, "length": initial, "factors": np.zeros(1, bool)}
        )
        pairs = zip(vars(given).values(), vars(last).values(), strict=True)
        both = SpatialPatterns(*(np.concatenate(pair) for pair in pairs))
        names = ("network", "mesh", "length", "bending", "system")
        super().__init__(
            GrowingModel(patterns=both, **{name: getattr(model, name) for name in names})
        )

    @property
    def scales(self) -> Float[np.ndarray, " parameters"]:
        """One each: nothing is measured by them."""
        return np.ones(self.model.patterns.count)


def grow_stress(frame: SpatialFrameFields, p: Parameters) -> tuple[Lanes, Flags]:
    """Natural states: initial strains and actuators grow together from the frame as drawn."""
    growing = GrowingFrame(frame.model)
    target = np.concatenate([p, np.ones((len(p), 1))], axis=1)
    z, found = growing.natural_guess(p), np.ones(len(p), bool)
    for k in range(1, STEPS + 1):
        here = target * (k / STEPS)
        step = newton(growing, z, here, SURE)
        z, found = step.z, found & step.found
    return z, found & np.isfinite(z).all(axis=1)


def refuse_singular(frame: SpatialFrameFields) -> None:
    """Refuse mechanisms, and forces that deformations do not determine.

    Raises
    ------
    InputError
        With the joint or member that moves, or the members that supports stretch.
    """
    bare = GrowingFrame(frame.model) if frame.model.stressed else frame
    p = np.zeros((1, bare.model.patterns.count))
    z = bare.natural_guess(p)
    entries = bare.entries(z, p)
    if _is_regular(bare, entries):
        return
    matrix = bare.layout.dense(entries)[0]
    values, vectors = np.linalg.eigh(matrix)
    least = int(np.argmin(np.abs(values)))
    if np.abs(values[least]) > SINGULAR * np.abs(values).max():
        return
    mode = vectors[:, least]
    count = bare.tables.count
    turns, forces = mode[:count], mode[count:]
    if np.abs(turns).max() > np.abs(forces).max(initial=0.0):
        _refuse_mechanism(frame, turns)
    _refuse_stress(frame, forces)


def _is_regular(frame: SpatialFrameMechanics, entries: Float[np.ndarray, "1 entries"]) -> bool:
    """Whether the smallest eigenvalue is far from zero, by inverse iteration."""
    generator = np.random.default_rng(0)
    vector = generator.normal(size=(1, 1, frame.layout.size))
    smallest = np.inf
    for _ in range(SWEEPS):
        vector /= np.linalg.norm(vector)
        vector = frame.layout.solve(entries, None, vector).x
        size = float(np.linalg.norm(vector))
        if not np.isfinite(size):
            return False
        smallest = 1.0 / size
    return smallest > 10.0 * SINGULAR * float(np.abs(entries).max())


def _refuse_mechanism(frame: SpatialFrameFields, turns: Float[np.ndarray, " rows"]) -> NoReturn:
    made, p = frame.model.network, np.zeros((2, frame.model.patterns.count))
    free = len(frame.model.free)
    step = 1e-3 * turns / np.abs(turns).max()
    z = frame.natural_guess(p)
    vectors = np.zeros((free, 4))
    vectors[:, 1:] = 0.5 * step[: 3 * free].reshape(free, 3)
    change = np.concatenate([vectors.ravel(), step[3 * free :]])
    z[0, : frame.unknowns] += change
    z[1, : frame.unknowns] -= change
    there, back = frame.displacements(z, p)
    if np.abs(there - back).max() > MOVING:
        at, direction = direction_of_mechanism(there - back)
        what = f"joint {made.joints[at]} can move along ({direction})"
    else:
        ends = frame.turns_of_ends(z[:1], p[:1])[0]
        piece = int(np.argmax(np.abs(ends).max(axis=(1, 2))))
        name = made.members[made.owner[piece]].name
        what = f"member {name} can turn about itself"
    raise InputError(
        f"`frame` must be no mechanism; {what} without force. Add a member or a support, or leave "
        "out a hinge."
    )


def _refuse_stress(
    frame: SpatialFrameFields, forces: Float[np.ndarray, " multipliers"]
) -> NoReturn:
    made, count = frame.model.network, frame.constraints
    size = np.linalg.norm(
        np.einsum("s,ska->ka", forces, frame.model.forces.members[:count]), axis=1
    )
    names = [made.edge_names[k] for k in np.flatnonzero(size > 0.1 * size.max())]
    if len(names) > NAMED:
        names = [*names[:NAMED], f"{len(names) - NAMED} more"]
    raise InputError(
        f"`supports` must not stretch or squeeze inextensible members; got {', '.join(names)} held "
        "at a length that they have already. Give one of them EA, or release a support."
    )


def discretisation_error(
    frame: SpatialFrameFields, finer: SpatialFrameFields, z: Lanes, p: Parameters
) -> Values:
    """Twice the largest change of displacements, turns of ends and max |κ| on a finer frame.

    Displacements and curvature are relative to the mean length of the pieces. Infinite where the
    finer frame has no equilibrium near the state, as may happen at a fold.
    """
    model, fine = frame.model, finer.model
    matrix = model.mesh.interpolation(fine.mesh.nodes)
    turns = frame.turns(z, p)
    bodies = len(model.network.bodies)
    nodes = np.zeros((len(z), len(fine.turning), 4))
    nodes[:, :bodies] = turns[:, :bodies]
    along = np.einsum("ij,lkja->lkia", matrix, turns[:, model.piece_nodes])
    along /= np.linalg.norm(along, axis=-1, keepdims=True)
    nodes[:, fine.piece_nodes[:, 1:-1]] = along[:, :, 1:-1]
    first = 4 * len(model.free)
    q = nodes[:, fine.free].reshape(len(z), 4 * len(fine.free))
    start = np.concatenate([q, z[:, first:]], axis=1)

    def correction(at: Lanes) -> Lanes:
        return np.asarray(finer.solve(at, p, -finer.residual(at, p)[:, None]).x[:, 0])

    def change(at: Lanes) -> Values:
        largest = np.zeros(len(z))
        for name in ("displacements", "turns_of_ends", "largest_curvatures"):
            apart = np.abs(getattr(finer, name)(at, p) - getattr(frame, name)(z, p))
            largest = np.maximum(largest, apart.max(axis=tuple(range(1, apart.ndim))))
        return largest

    return error_by_refinement(start, correction, change)
