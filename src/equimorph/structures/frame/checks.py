"""Checks of a frame: its state at rest is unique, and how large its discretisation error is."""

import numpy as np
from jaxtyping import Float

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.structures.frame.fields import FrameFields
from equimorph.structures.network import direction_of_mechanism
from equimorph.structures.rod.discretisation import error_by_refinement
from equimorph.tolerances import SINGULAR


def refuse_singular(frame: FrameFields) -> None:
    """Refuse mechanisms, and forces that deformations do not determine.

    Raises
    ------
    InputError
        With the joint or member that moves, or the members that supports stretch.
    """
    z, p = np.zeros((1, frame.size)), np.zeros((1, len(frame.parameters)))
    matrix = frame.layout.dense(frame.entries(z, p))[0]
    values, vectors = np.linalg.eigh(matrix)
    least = int(np.argmin(np.abs(values)))
    if np.abs(values[least]) > SINGULAR * np.abs(values).max():
        return
    mode = vectors[:, least]
    turns, forces = mode[: frame.unknowns], mode[frame.unknowns :]
    if np.abs(turns).max() > np.abs(forces).max(initial=0.0):
        _refuse_mechanism(frame, mode)
    _refuse_stress(frame, forces)


def _refuse_mechanism(frame: FrameFields, mode: Float[np.ndarray, " size"]) -> None:
    made, p = frame.model.network, np.zeros((1, len(frame.parameters)))
    step = 1e-3 * mode[None] / np.abs(mode).max()
    moves = (frame.displacements(step, p) - frame.displacements(-step, p))[0]
    if np.abs(moves).max() > 1e-6:
        at, direction = direction_of_mechanism(moves)
        what = f"joint {made.joints[at]} can move along ({direction})"
    else:
        ends = frame.turns_of_ends(step, p)[0]
        member = int(np.argmax(np.abs(ends).max(axis=1)))
        what = f"member {made.members[member].name} can turn"
    raise InputError(
        f"`frame` must be no mechanism; {what} without force. Add a member or a support, or leave "
        "out a hinge."
    )


def _refuse_stress(frame: FrameFields, forces: Float[np.ndarray, " multipliers"]) -> None:
    made, count = frame.model.network, frame.constraints
    size = sum(np.abs(forces @ each.start[:count]) for each in frame.model.forces)
    some = np.asarray(size) > 0.1 * np.max(size)
    names = [member.name for member, stressed in zip(made.members, some, strict=True) if stressed]
    raise InputError(
        f"`supports` must not stretch or squeeze inextensible members; got {', '.join(names)} held "
        "at a length that they have already. Give one of them EA, or release a support."
    )


def discretisation_error(frame: FrameFields, finer: FrameFields, z: Lanes, p: Parameters) -> Values:
    """Twice the largest change of displacements, turns of ends and max |κ| on a finer frame.

    Displacements and curvature are relative to the mean length of the members. Infinite where the
    finer frame has no equilibrium near the state, as may happen at a fold.
    """
    model, fine = frame.model, finer.model
    matrix = model.mesh.interpolation(fine.mesh.nodes)
    turns = frame.turns(z, frame.scalars(z, p))[:, model.member_nodes] @ matrix.T
    nodes = np.zeros((len(z), len(fine.place)))
    nodes[:, fine.member_nodes] = turns
    start = np.concatenate([nodes[:, fine.place >= 0], z[:, frame.unknowns :]], axis=1)

    def correction(at: Lanes) -> Lanes:
        return np.asarray(finer.solve(at, p, -finer.residual(at, p)[:, None]).x[:, 0])

    def change(at: Lanes) -> Values:
        largest = np.zeros(len(z))
        for name in ("displacements", "turns_of_ends", "largest_curvatures"):
            apart = np.abs(getattr(finer, name)(at, p) - getattr(frame, name)(z, p))
            largest = np.maximum(largest, apart.max(axis=tuple(range(1, apart.ndim))))
        return largest

    return error_by_refinement(start, correction, change)
