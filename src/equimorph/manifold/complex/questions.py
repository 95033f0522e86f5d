"""What an equilibrium set depends on, as text: the question that a journal belongs to."""

import json
from hashlib import sha256
from importlib.metadata import version

import numpy as np

from equimorph.manifold.complex.equilibrium_set import EquilibriumSet
from equimorph.manifold.geometry.setting import Setting
from equimorph.model import Box


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
        If the structure cannot be written down.
    """
    within = [
        (each.descriptor.name, each.sense, each.bound, each.ease) for each in setting.constraints
    ]
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
    within = [str(each) for each in eset.constraints]
    return json.dumps(["refined", version("equimorph"), check.hexdigest(), within, accuracy])
