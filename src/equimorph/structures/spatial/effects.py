"""What loads, tendons and actuated curvatures do to a rod in space."""

from dataclasses import dataclass

import numpy as np

from equimorph.array_types import Float
from equimorph.errors import InputError
from equimorph.structures.rod import terms
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.profiles import at_nodes, inside

AXES = "tnb"
"""Axes of the cross-section: tangent, normal in the plane of a planar rod, binormal."""


@dataclass(frozen=True, eq=False)
class SpatialEffects:
    """What a term of amplitude 1 does.

    Attributes
    ----------
    force
        Load cumulated from end A, and `total` all of it.
    moment
        Part of the moment, on the axes of the cross-section, that does not come from strains.
    natural
        Intrinsic strains: twist, curvatures about n and b.
    tension, torsion
        Pull of cables along the rod, and the torsional stiffness that they give it.
    """

    force: Float[np.ndarray, "elements order 3"]
    total: Float[np.ndarray, "3"]
    moment: Float[np.ndarray, "elements order 3"]
    natural: Float[np.ndarray, "elements order 3"]
    tension: Float[np.ndarray, "elements order"]
    torsion: Float[np.ndarray, "elements order"]

    @classmethod
    def none(cls, mesh: Mesh) -> "SpatialEffects":
        """No effects at all."""
        shape = (mesh.elements, mesh.degree + 1)
        force, moment, natural = np.zeros((3, *shape, 3))
        tension, torsion = np.zeros((2, *shape))
        return cls(force, np.zeros(3), moment, natural, tension, torsion)


def direction_in_space(value: object) -> Float[np.ndarray, "3"]:
    """Direction of two or three numbers, as three."""
    given = np.array(value, dtype=float)
    return np.append(given, np.zeros(3 - len(given)))


def effects(term: terms.Term, mesh: Mesh) -> SpatialEffects:
    """Effects of a term on the nodes of a mesh whose element ends meet its breaks."""
    out = SpatialEffects.none(mesh)
    match term:
        case terms.LineLoad():
            rho, unit = term.density().cumulate(mesh), direction_in_space(term.direction)
            out.force[:] = rho[..., None] * unit
            out.total[:] = rho[-1, -1] * unit
        case terms.PointForce():
            beyond, unit = inside(term.s, 2.0, mesh), direction_in_space(term.direction)
            out.force[:] = beyond[:, None, None] * unit
            out.total[:] = unit
        case terms.Curvature():
            there = inside(term.start, term.stop, mesh)[:, None]
            out.natural[..., AXES.index(term.about)] = there * at_nodes(term.profile(), mesh)
        case terms.Tendon():
            there = inside(term.start, term.stop, mesh)[:, None]
            left, aside = (there * at_nodes(each, mesh) for each in term.profiles())
            out.moment[..., 1], out.moment[..., 2] = -aside, left
            out.tension[:], out.torsion[:] = there, left**2 + aside**2
    return out


def check_potential(name: str, term: terms.Term) -> None:
    """Refuse what has no potential in space.

    Raises
    ------
    InputError
        For couples and pressure.
    """
    if isinstance(term, terms.Couple):
        raise InputError(
            f"`{name}` must have a potential; got a couple: about an axis that stays where it is, "
            "its work in space depends on the way. Turn a clamp, or use a pair of forces."
        )
    if isinstance(term, terms.Pressure):
        raise InputError(
            f"`{name}` must have a potential; got pressure, which on a curve in space has none. "
            "Use a dead line load."
        )
