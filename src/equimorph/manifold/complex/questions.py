"""What an equilibrium set depends on, as text: the question that a journal belongs to."""

import json
from hashlib import sha256
from importlib.metadata import version
from typing import Any

import numpy as np

from equimorph.equilibria import worst_named
from equimorph.errors import InputError
from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.setting import Setting
from equimorph.model import Box, Constraint, Descriptor, content_of_descriptor
from equimorph.structures import Structure


def question_of_set(
    setting: Setting,
    box: Box,
    intervals: tuple[int, ...],
    effort: tuple[int, int, float | None],
) -> str:
    """All that a set depends on; `effort` are the seed, the number of checks, and the accuracy.

    Raises
    ------
    InputError
        If the structure cannot be written down, or a constraint is on a function whose content
        cannot be told.
    """
    within = [_words(setting.structure, each) for each in setting.constraints]
    given = {
        "release": version("equimorph"),
        "structure": setting.structure.identity(),
        "base": setting.base.tolist(),
        "box": [box.names, box.lower.tolist(), box.upper.tolist()],
        "within": within,
        "intervals": intervals,
        "effort": effort,
    }
    return json.dumps(given, sort_keys=True)


def question_of_refinement(eset: EquilibriumSet, accuracy: float) -> str:
    """All that a refined set depends on."""
    check = sha256()
    for part in (eset.points.z, eset.points.p, eset.index, eset.cells):
        check.update(np.ascontiguousarray(part).tobytes())
    within = [_words(eset.structure, each) for each in eset.constraints]
    return json.dumps(["refined", version("equimorph"), check.hexdigest(), within, accuracy])


def _words(structure: Structure, constraint: Constraint) -> list[Any]:
    """Constraint as plain data; a user's function by its content, as its name says nothing."""
    descriptor = constraint.descriptor
    return [
        descriptor.name,
        "" if _is_own(structure, descriptor) else content_of_descriptor(descriptor),
        constraint.sense,
        constraint.bound,
        constraint.ease,
    ]


def _is_own(structure: Structure, descriptor: Descriptor) -> bool:
    """Whether the structure itself gives this descriptor by its name."""
    try:
        return worst_named(structure, descriptor.name) == descriptor
    except InputError:
        return False
