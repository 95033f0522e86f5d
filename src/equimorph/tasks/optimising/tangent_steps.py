"""Moving on an equilibrium set in coordinates of its tangent spaces."""

from dataclasses import replace

import numpy as np

from equimorph.arrays import Flags, Float, Frames, Lanes, Parameters, Rows
from equimorph.equilibria import settle
from equimorph.equilibria.sensitivity import answers
from equimorph.manifold import EquilibriumSet
from equimorph.manifold.geometry.exact_points import Aim, correct_between, correct_points
from equimorph.manifold.geometry.setting import Setting, embed
from equimorph.manifold.geometry.tangents import frames_in_embedding, split_step, tangent_frames
from equimorph.manifold.queries.nearest import FAR, SetPoints
from equimorph.structures import State, States
from equimorph.structures.metric import metric_coordinates

Steps = Float[np.ndarray, "lanes d"]


def tangent_planes(setting: Setting, states: States) -> Rows:
    """Planes near the tangent spaces of stable states."""
    structure, free = setting.structure, setting.free
    dz, dp = answers(structure, states.z, states.p, free)
    u = metric_coordinates(structure, dz)
    both = np.concatenate([u, dp[:, :, free] / structure.scales[free]], axis=2)
    return np.ascontiguousarray(np.swapaxes(np.linalg.qr(np.swapaxes(both, 1, 2))[0], 1, 2))


def unconstrained_setting(eset: EquilibriumSet) -> Setting:
    """Structure and free parameters of a set, without its constraints: steps may cross these."""
    return replace(eset.setting, constraints=())


def tangents_at(setting: Setting, at: SetPoints) -> tuple[Frames, SetPoints]:
    """Orthonormal tangents at points, and the points with these as their planes."""
    frames = tangent_frames(setting, at.z, at.p, at.rows)
    return frames, SetPoints(at.z, at.p, frames_in_embedding(setting, frames))


def step_along(
    setting: Setting, at: SetPoints, frames: Frames, steps: Steps
) -> tuple[Lanes, Parameters]:
    """Points of the tangent spaces, off the set by the square of the step."""
    dz, dp = split_step(setting, np.einsum("ld,ldf->lf", steps, frames))
    return at.z + dz, at.p + dp


def bend_onto_set(
    setting: Setting, z: Lanes, p: Parameters, frames: Frames, error: float
) -> tuple[Lanes, Parameters, Frames, Flags]:
    """Points of the set orthogonally above points, with their tangents, and where there are any.

    In planes along given tangents; up to an error in the metric.
    """
    rows, far = frames_in_embedding(setting, frames), np.full(len(z), FAR)
    there = correct_between(setting, z, p, embed(setting, z, p), rows, far, error)
    return there.z, there.p, there.frames, there.found


def project_onto_set(
    setting: Setting, z: Lanes, p: Parameters, rows: Rows
) -> tuple[SetPoints, Flags]:
    """Points of the set orthogonally above points, in planes, and where there are any."""
    d = len(setting.free)
    span = np.tile(np.eye(d), (len(z), 1, 1))
    aim = Aim(setting, False, False, span, embed(setting, z, p), rows)
    pinned = correct_points(aim, z, p, np.full(len(z), FAR))
    return SetPoints(pinned.z, pinned.p, rows), pinned.found


def move_into_box(eset: EquilibriumSet, state: State) -> State:
    """State whose parameters do not exceed the box by rounding."""
    box, free = eset.box, unconstrained_setting(eset).free
    p = state.p.copy()
    p[free] = np.clip(p[free], box.lower, box.upper)
    inside = settle(state.structure, state.z[None], p[None])
    return State(state.structure, inside.z[0], p) if inside.found[0] else state
