"""Sets in journals: the question that a set answers, and the set as one entry.

See docs/decisions.md, "Journals keep whole sets".
"""

import json
from collections.abc import Callable, Mapping
from dataclasses import asdict, astuple, dataclass, fields
from hashlib import sha256
from importlib.metadata import version
from typing import Any

import numpy as np

from equimorph.equilibria import worst_named
from equimorph.errors import InputError
from equimorph.manifold.complex.audit import Audit
from equimorph.manifold.complex.base_mesh import BaseMesh
from equimorph.manifold.complex.equilibrium_set import (
    Boundary,
    BoundaryKind,
    Component,
    EquilibriumSet,
    Stratum,
)
from equimorph.manifold.geometry.setting import Setting
from equimorph.model import (
    Box,
    Constraint,
    Descriptor,
    Findings,
    Journal,
    content_of_descriptor,
    recall_or_compute,
)
from equimorph.structures import States, Structure


@dataclass(frozen=True)
class Effort:
    """How thoroughly a set is lifted; see `equilibrium_set`.

    room: how many times the equilibria over the undivided grid bisection may bring, if that is more
    than the limit.
    """

    seed: int
    checks: int
    accuracy: float | None
    limit: int
    tiles: tuple[int, ...] | None = None
    room: float = 0.0


def question_of_set(setting: Setting, box: Box, intervals: tuple[int, ...], effort: Effort) -> str:
    """All that a set depends on.

    Refused if the structure cannot be written down, or a constraint is on a function without known
    content.
    """
    within = [_words(setting.structure, each) for each in setting.constraints]
    given = {
        "release": version("equimorph"),
        "structure": setting.structure.identity(),
        "base": setting.base.tolist(),
        "box": [box.names, box.lower.tolist(), box.upper.tolist()],
        "within": within,
        "intervals": intervals,
        "effort": astuple(effort),
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


ARRAYS = ("kinds", "index", "cells", "cell_index", "component", "stratum", "grid_vertex")
MESH = tuple(each.name for each in fields(BaseMesh))
PIECES = ("folds", "crossings")


def recall_set(
    journal: Journal,
    question: str,
    setting: Setting,
    box: Box,
    fixed: Mapping[str, float],
    compute: Callable[[], EquilibriumSet],
) -> EquilibriumSet:
    """Return the set that a journal keeps for a question; without one, compute and keep it.

    What is kept of tiles while it is computed gives way to the set. Refused if the journal is that
    of another question.
    """
    journal.begin(question)
    entry = journal.recall("set")
    if entry is None:
        journal.begin(question)
        found = _entry(compute())
        journal.begin(question)
        entry = recall_or_compute(journal, "set", lambda: found)
    return _set(entry, setting, box, fixed)


def _entry(eset: EquilibriumSet) -> Findings:
    """All arrays of a set, after the rest of it as text."""
    pieces = {name: getattr(eset, name) for name in PIECES}
    text = json.dumps(
        {
            "intervals": eset.intervals,
            "pieces": {name: len(own) for name, own in pieces.items()},
            "boundaries": [each.kind for each in eset.boundaries],
            "components": [asdict(each) for each in eset.components],
            "strata": [asdict(each) for each in eset.strata],
            "audit": asdict(eset.audit),
        }
    )
    return (
        np.frombuffer(text.encode(), np.uint8),
        eset.points.z,
        eset.points.p,
        *(getattr(eset, name) for name in ARRAYS),
        *(getattr(eset.mesh, name) for name in MESH),
        *(each.vertices for each in eset.boundaries),
        *(piece for own in pieces.values() for piece in own),
    )


def _set(entry: Findings, setting: Setting, box: Box, fixed: Mapping[str, float]) -> EquilibriumSet:
    """Return the set that `_entry` took apart."""
    header, z, p, *arrays = entry
    text = json.loads(header.tobytes(), object_hook=_with_tuples)
    rest = iter(arrays)
    named: dict[str, Any] = {name: next(rest) for name in ARRAYS}
    mesh = BaseMesh(**{name: next(rest) for name in MESH})
    boundaries = tuple(Boundary(next(rest), BoundaryKind(kind)) for kind in text["boundaries"])
    pieces: dict[str, Any] = {
        name: tuple(next(rest) for _ in range(count)) for name, count in text["pieces"].items()
    }
    return EquilibriumSet(
        structure=setting.structure,
        box=box,
        fixed=fixed,
        constraints=setting.constraints,
        intervals=text["intervals"],
        points=States(setting.structure, z, p),
        boundaries=boundaries,
        components=tuple(Component(**each) for each in text["components"]),
        strata=tuple(Stratum(**each) for each in text["strata"]),
        audit=Audit(**text["audit"]),
        mesh=mesh,
        **named,
        **pieces,
    )


def _with_tuples(value: dict[str, Any]) -> dict[str, Any]:
    """Lists as tuples, which JSON does not know."""
    return {name: _tuple(each) for name, each in value.items()}


def _tuple(value: Any) -> Any:
    return tuple(map(_tuple, value)) if isinstance(value, list) else value
