"""Sets without end: whole turns repeat a state over a point, and no constraint bounds them.

See docs/decisions.md, "Whole turns that no constraint bounds are refused early".
"""

import numpy as np

from equimorph.arrays import Flags, Float, Lanes
from equimorph.equilibria.settle import Guards, settle
from equimorph.errors import EndlessError
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.setting import Setting
from equimorph.model import are_feasible
from equimorph.structures import States
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_STATE

REPEATED, FURTHER = 6, 100
"""Times that whole turns repeat a state over one point from which on the set is refused, if it may
turn so many times further."""
TURN = 2.0 * np.pi
PROOF = np.array([*range(1, REPEATED), FURTHER])
"""Whole turns of a state after which it must be one again, where one copy of it was found."""


def named_point(setting: Setting, p: Float[np.ndarray, " parameters"]) -> str:
    """Free parameters at a point with their names."""
    names = [setting.structure.parameters[place].name for place in setting.free]
    return ", ".join(f"{name} = {p[at]:g}" for name, at in zip(names, setting.free, strict=True))


def refuse_turns(setting: Setting, p: Float[np.ndarray, " parameters"]) -> None:
    """Say that whole turns repeat a state over a point.

    Raises
    ------
    EndlessError
        Always.
    """
    raise EndlessError(
        f"`within` must bound whole turns: over {named_point(setting, p)} they repeat a state "
        f"{REPEATED} times, and without end. Bound a descriptor that grows with them: an angle, or "
        "the rotation of a member that is hinged at both ends."
    )


def turns_between(
    setting: Setting, z: Lanes, other: Float[np.ndarray, "*lanes size"]
) -> tuple[Lanes, Flags]:
    """Whole turns by which states differ in some unknowns, and whether they differ in them only."""
    apart = z - other
    turned = np.rint(apart / TURN)
    turned[:, setting.structure.unknowns :] = 0.0
    return turned, np.abs(apart - TURN * turned).max(axis=1, initial=0.0) < SAME_STATE


def are_repeated(setting: Setting, z: Lanes, p: Float[np.ndarray, " parameters"]) -> bool:
    """Whether states over a point are one but for whole turns, and more turns are allowed."""
    if not np.ptp(z[:, : setting.structure.unknowns], axis=0).max() > (REPEATED - 2) * TURN:
        return False
    for own in z:
        turned, copies = turns_between(setting, z, own)
        if copies.sum() < REPEATED:
            continue
        axis = np.abs(turned[copies]).max(axis=0).argmax()
        if len(np.unique(turned[copies, axis])) >= REPEATED:
            furthest = np.flatnonzero(copies)[np.abs(turned[copies, axis]).argmax()]
            beyond = own + TURN * FURTHER * turned[[furthest]]
            return bool(are_feasible(setting.constraints, beyond, p[None])[0])
    return False


def refuse_copies(eset: EquilibriumSet, missing: States) -> None:
    """Refuse a set that lacks copies of its states, whole turns away, of which there are ever more.

    One copy tells how far to turn: the state is turned as far again and again, one way or the
    other, and must be an equilibrium within the constraints each time. Copies that are no other
    states of the structure (`whole_turns`) are not meant.

    Raises
    ------
    EndlessError
        If a state has such copies.
    """
    setting, structure = eset.setting, eset.structure
    known, point, _ = eset.sheets.over(missing.p)
    z, taken_back = missing.z[point], structure.whole_turns.taken_back
    turned, copies = turns_between(setting, z, known.z)
    copies &= turned.any(axis=1)
    copies &= metric_length(structure, taken_back(z) - taken_back(known.z)) > SAME_STATE
    some = np.flatnonzero(copies)
    for sign in (1.0, -1.0):
        moves = sign * TURN * PROOF[:, None] * turned[some][:, None]
        again = (known.z[some][:, None] + moves).reshape(-1, structure.size)
        p = np.repeat(known.p[some], len(PROOF), axis=0)
        trust = Guards(iterations=2, trust=np.full(len(p), SAME_STATE), within=setting.constraints)
        endless = settle(structure, again, p, guards=trust).found.reshape(-1, len(PROOF))
        for own in some[endless.all(axis=1)]:
            refuse_turns(setting, known.p[own])
