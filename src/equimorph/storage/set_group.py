"""An equilibrium set as an HDF5 group."""

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import h5py
import numpy as np
from jaxtyping import Float, Int

from equimorph.manifold import Audit, Boundary, Component, EquilibriumSet, Stratum
from equimorph.manifold.mesh import BaseMesh
from equimorph.model import Box, Constraint, Descriptor, names_of
from equimorph.storage.hdf import add_dimension, get, get_json, put, put_json
from equimorph.structures import States, Structure

ABOUT = "about"
GRID = ("vertices", "edges", "triangles", "sides")
"""Arrays of the triangulation of the box."""


def write(group: h5py.Group, eset: EquilibriumSet, height: Descriptor) -> None:
    """Write a set.

    Parameters
    ----------
    group
        An empty group.
    eset
        The set.
    height
        Third coordinate of the embedding.
    """
    points, parameters = eset.points, names_of(eset.structure.parameters)
    # At the top, so that the arrays keep their dimensions where the grid links to them.
    for name, size in (("vertex", len(points)), ("cell", len(eset.cells)), ("space", 3)):
        add_dimension(group.file, name, size)
    add_dimension(group.file, "corner", eset.cells.size)
    put(group, "parameter_name", np.array(parameters), ["parameter"])
    put(group, "z", points.z, ["vertex", "unknown"], "unknowns and multipliers")
    put(group, "p", points.p, ["vertex", "parameter"], "parameters, see parameter_name")
    put(group, "kind", eset.kinds, ["vertex"], "see EquilibriumSet.kinds")
    put(group, "grid_vertex", eset.grid_vertex, ["vertex"], "vertex of the grid below, or -1")
    put(group, "index", eset.index, ["vertex"], "negative eigenvalues; 0 is stable")
    put(group, "energy", points.energy, ["vertex"], "potential energy")
    for each in {d.name: d for d in [height, *(c.descriptor for c in eset.constraints)]}.values():
        put(group, each.name.replace("/", "_over_"), each(points), ["vertex"], each.unit)
    put(
        group, "connectivity", eset.cells.ravel(), ["corner"], "vertices of each triangle, by three"
    )
    put(group, "cell_index", eset.cell_index, ["cell"], "index of the stratum")
    put(group, "component", eset.component, ["cell"])
    put(group, "stratum", eset.stratum, ["cell"])
    put(group, "embedding", _embedding(eset, height), ["vertex", "space"], "for looking at")
    for name in GRID:
        put(group, f"grid_{name}", getattr(eset.mesh, name), [f"grid_{name}_entry", f"of_{name}"])
    _put_chains(group, "fold", eset.folds)
    _put_chains(group, "boundary", [each.vertices for each in eset.boundaries])
    put_json(group, ABOUT, _about(eset))


def read(group: h5py.Group, structure: Structure) -> EquilibriumSet:
    """Read what `write` wrote."""
    about = get_json(group, ABOUT)
    chains = zip(_chains(group, "boundary"), about["boundary_kinds"], strict=True)
    return EquilibriumSet(
        structure=structure,
        box=Box(**about["box"]),
        fixed=about["fixed"],
        constraints=tuple(
            Constraint(structure.descriptor(text), sense, bound)
            for text, sense, bound in about["constraints"]
        ),
        intervals=tuple(about["intervals"]),
        points=States(structure, get(group, "z"), get(group, "p")),
        kinds=get(group, "kind"),
        index=get(group, "index"),
        cells=get(group, "connectivity").reshape(-1, 3),
        cell_index=get(group, "cell_index"),
        component=get(group, "component"),
        stratum=get(group, "stratum"),
        folds=tuple(_chains(group, "fold")),
        boundaries=tuple(Boundary(vertices, kind) for vertices, kind in chains),
        components=tuple(Component(**_tuples(each)) for each in about["components"]),
        strata=tuple(Stratum(**_tuples(each)) for each in about["strata"]),
        audit=Audit(**_tuples(about["audit"])),
        mesh=BaseMesh(**{name: get(group, f"grid_{name}") for name in GRID}),
        grid_vertex=get(group, "grid_vertex"),
    )


def _about(eset: EquilibriumSet) -> dict[str, object]:
    box = eset.box
    sides = zip(box.names, box.lower.tolist(), box.upper.tolist(), strict=True)
    return {
        "box": {name: [low, high] for name, low, high in sides},
        "fixed": dict(eset.fixed),
        "constraints": [[c.descriptor.name, c.sense, c.bound] for c in eset.constraints],
        "intervals": list(eset.intervals),
        "boundary_kinds": [each.kind for each in eset.boundaries],
        "components": [asdict(each) for each in eset.components],
        "strata": [asdict(each) for each in eset.strata],
        "audit": asdict(eset.audit),
    }


def _tuples(value: Any) -> Any:
    """Plain data from JSON, which knows no tuples, as a frozen dataclass holds it."""
    if isinstance(value, dict):
        return {name: _tuples(each) for name, each in value.items()}
    return tuple(_tuples(each) for each in value) if isinstance(value, list) else value


def _embedding(eset: EquilibriumSet, height: Descriptor) -> Float[np.ndarray, "vertices 3"]:
    return np.column_stack([eset.coordinates, height(eset.points)])


def _put_chains(group: h5py.Group, name: str, chains: Sequence[Int[np.ndarray, " _"]]) -> None:
    """Write chains of vertices one after the other, and where each of them ends."""
    joined = np.concatenate([np.zeros(0, dtype=np.int64), *chains])
    ends = np.cumsum([len(chain) for chain in chains], dtype=np.int64)
    put(group, f"{name}_vertex", joined, [f"{name}_entry"], f"vertices of each {name} in order")
    put(group, f"{name}_end", ends, [name], f"entries before the end of each {name}")


def _chains(group: h5py.Group, name: str) -> list[Int[np.ndarray, " _"]]:
    ends = get(group, f"{name}_end")
    return list(np.split(get(group, f"{name}_vertex"), ends[:-1])) if len(ends) else []
