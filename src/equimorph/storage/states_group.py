"""States as an HDF5 group."""

import h5py

from equimorph.storage.hdf import get, put
from equimorph.structures import States, Structure


def write(group: h5py.Group, states: States) -> None:
    """Write states, with what people want to know of them."""
    put(group, "z", states.z, ["state", "unknown"], "unknowns and multipliers")
    put(group, "p", states.p, ["state", "parameter"], "parameters")
    put(group, "index", states.index, ["state"], "negative eigenvalues; 0 is stable")
    put(group, "margin", states.margin, ["state"], "stability margin")
    put(group, "energy", states.energy, ["state"], "potential energy")


def read(group: h5py.Group, structure: Structure) -> States:
    """Read what `write` wrote."""
    return States(structure, get(group, "z"), get(group, "p"))
