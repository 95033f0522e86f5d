"""Trusses: pin-jointed bars in the plane and in space, geometrically exact."""

from equimorph.structures.truss.network import Bar as Bar
from equimorph.structures.truss.truss import Truss as Truss
