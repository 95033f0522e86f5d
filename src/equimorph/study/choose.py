"""Which of several stable equilibria over one point is meant."""

import numpy as np

from equimorph.arrays import Values
from equimorph.equilibria import worst_named
from equimorph.errors import InputError
from equimorph.manifold import EquilibriumSet
from equimorph.structures import State, States
from equimorph.study.sections.extent import StateSection

AGREEMENT = 1e-3
"""A descriptor given with `near` agrees when it is this close: values are copied from a report."""


def choose_state(eset: EquilibriumSet, section: StateSection, key: str) -> State:
    """Return the stable equilibrium that a section of a study describes.

    Parameters
    ----------
    eset
        The equilibrium set.
    section
        Point, and how to choose among the stable equilibria over it.
    key
        Key of the study file, for messages.

    Raises
    ------
    InputError
        If nothing stable is there, if the choice is left open, or if `near` meets no equilibrium.
    """
    here = eset.at(**section.at)
    stable = here.stable
    if not len(stable):
        raise InputError(
            f"`{key}.at` must have a stable equilibrium; got {len(here)} equilibria, none stable, "
            f"at {_point(section.at)}."
        )
    if section.near is not None:
        return _nearest(here, section.near, key)
    if section.highest is not None:
        values = worst_named(eset.structure, section.highest)(stable)
        return stable[int(np.argmax(values))]
    if section.lowest is not None:
        values = worst_named(eset.structure, section.lowest)(stable)
        return stable[int(np.argmin(values))]
    if len(stable) > 1:
        raise InputError(
            f"`{key}` must choose by highest, lowest or near; got {len(stable)} stable equilibria "
            f"at {_point(section.at)}."
        )
    return stable[0]


def chosen_start(eset: EquilibriumSet, section: StateSection | None, key: str) -> State | None:
    """Return the state to start from, if a section asks for one; see `choose_state`."""
    return None if section is None else choose_state(eset, section, key)


def _nearest(here: States, near: dict[str, float], key: str) -> State:
    ((text, wanted),) = near.items()
    values: Values = worst_named(here.structure, text)(here)
    best = int(np.argmin(np.abs(values - wanted)))
    state = here[best]
    if abs(values[best] - wanted) > AGREEMENT:
        found = ", ".join(f"{value:.4g}" for value in np.sort(values[here.index == 0]))
        raise InputError(
            f"`{key}.near` must be an equilibrium within {AGREEMENT:g}; got {text} = {wanted:g}, "
            f"but stable ones have {found}."
        )
    if not state.stable:
        raise InputError(
            f"`{key}.near` must be a stable equilibrium; got {text} = {wanted:g}, "
            f"which has index {state.index}."
        )
    return state


def _point(point: dict[str, float]) -> str:
    return ", ".join(f"{name} = {value:g}" for name, value in point.items())
