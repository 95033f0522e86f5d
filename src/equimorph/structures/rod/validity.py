"""Where the planar model of a rod ends: contact with itself, and buckling out of the plane."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float
from numpy.polynomial import legendre

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.ends import FREE, End
from equimorph.structures.rod.general import GeneralMechanics
from equimorph.structures.rod.general_field_kernels import KAPPA, MOMENT
from equimorph.structures.rod.measured import Measured
from equimorph.structures.rod.profiles import at_nodes, profile

SAMPLES = 129
"""Arclengths at which distances are compared first."""
POLISHING = 4
"""Newton iterations towards the closest points."""

Curve = Float[np.ndarray, "lanes samples 4"]


def stations() -> Float[np.ndarray, " samples"]:
    """Arclengths at which `closest_approach` wants the fields."""
    return np.linspace(0.0, 1.0, SAMPLES)


def closest_approach(fields: Curve, apart: float) -> tuple[Values, Values]:
    """Smallest distance between points whose arclengths differ by `apart` at least.

    The closest pair of samples, improved by Newton on the osculating parabolas of both points;
    third order in the spacing of the samples.

    Parameters
    ----------
    fields
        (θ, κ, x, y) at `stations`, by lengths of the rod.
    apart
        Least distance along the rod, as a share of its length.

    Returns
    -------
    Distances, and the arclength of the first point of each pair.
    """
    s = stations()
    x, y = fields[:, :, 2], fields[:, :, 3]
    far = s[None, :] - s[:, None] >= apart - 1e-12
    square = (x[:, :, None] - x[:, None]) ** 2 + (y[:, :, None] - y[:, None]) ** 2
    square = np.where(far, square, np.inf).reshape(len(x), -1)
    first, last = np.divmod(square.argmin(axis=1), len(s))
    lanes = np.arange(len(x))
    here, there = fields[lanes, first], fields[lanes, last]
    spacing = s[1]
    start, stop = np.zeros((2, len(x)))
    for _ in range(POLISHING):
        gap, (t, n), (u, m) = _gap(here, there, start, stop)
        slope = np.stack([-_dot(gap, t), _dot(gap, u)])
        a = _dot(t, t) - _dot(gap, n)
        b, c = -_dot(t, u), _dot(u, u) + _dot(gap, m)
        determinant = a * c - b * b
        with np.errstate(divide="ignore", invalid="ignore"):
            moves = (b * slope[1] - c * slope[0], b * slope[0] - a * slope[1])
            moves = tuple(np.nan_to_num(move / determinant, posinf=0, neginf=0) for move in moves)
        convex = (determinant > 0.0) & (a > 0.0)
        start = np.clip(start + np.where(convex, moves[0], 0.0), -spacing, spacing)
        stop = np.clip(stop + np.where(convex, moves[1], 0.0), -spacing, spacing)
        near = s[last] + stop - s[first] - start < apart  # at the least distance along the rod
        outside = (s[first] + start < 0.0) | (s[last] + stop > 1.0) | near
        start, stop = np.where(outside, 0.0, start), np.where(outside, 0.0, stop)
    gap = _gap(here, there, start, stop)[0]
    refined = np.minimum(np.hypot(*gap), np.sqrt(square[lanes, first * len(s) + last]))
    return np.asarray(refined), np.asarray(s[first] + start)


def _dot(a: Float[np.ndarray, "2 lanes"], b: Float[np.ndarray, "2 lanes"]) -> Values:
    return np.asarray(a[0] * b[0] + a[1] * b[1])


def _gap(
    here: Float[np.ndarray, "lanes 4"],
    there: Float[np.ndarray, "lanes 4"],
    start: Values,
    stop: Values,
) -> tuple[np.ndarray, tuple[np.ndarray, np.ndarray], tuple[np.ndarray, np.ndarray]]:
    """Vector from one point to the other; first and second derivatives of both places."""
    (place, *first), (other, *last) = (
        _parabola(fields, move) for fields, move in ((here, start), (there, stop))
    )
    return other - place, (first[0], first[1]), (last[0], last[1])


def _parabola(
    fields: Float[np.ndarray, "lanes 4"], move: Values
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Place on the osculating parabola, with derivatives."""
    theta, kappa, x, y = fields.T
    tangent = np.stack([np.cos(theta), np.sin(theta)])
    normal = kappa * np.stack([-tangent[1], tangent[0]])
    place = np.stack([x, y]) + move * tangent + 0.5 * move**2 * normal
    return place, tangent + move * normal, normal


Fine = Float[np.ndarray, "lanes elements fine"]


@dataclass(frozen=True, eq=False)
class LateralStiffness:
    """Stiffness of a rod against twist and against bending out of its plane.

    Parameters
    ----------
    torsion, lateral
        GJ and EI about the axis in the plane, relative to the bending stiffness B in the plane:
        numbers, tables [[s, f], ...] or callables.
    """

    torsion: Any
    lateral: Any

    def __post_init__(self) -> None:
        """Check that both are positive."""
        for name in ("torsion", "lateral"):
            lowest = profile(getattr(self, name), name).density(np.linspace(0.0, 1.0, 201)).min()
            if not lowest > 0.0:
                raise InputError(f"`{name}` must be positive everywhere; got {lowest:g}.")


def lateral_margin(
    rod: GeneralMechanics, ends: tuple[End, End], stiffness: LateralStiffness, z: Lanes,
    p: Parameters,
) -> Values:  # fmt: skip
    """Smallest eigenvalue of the second variation for movements out of the plane.

    A small rotation φ about the tangent and ψ about the normal twists the rod by φ' − κψ and bends
    it out of the plane by ψ' + κφ; to second order it takes ½ (φ (ψ' + κφ) − ψ (φ' − κψ)) from the
    curvature in the plane and turns the tangent by −½ ψ² t + ½ φψ n. With the moment M, thrust N
    and shear force M' of the state

        ½ ∫ C (φ' − κψ)² + A (ψ' + κφ)² − M (φ (ψ' + κφ) − ψ (φ' − κψ)) − N ψ² + M' φψ ds

    relative to ∫ φ² + ψ². Ends that are held in the plane, or pinned on an axis across it, hold φ
    and ψ; where both ends are supported, ∫ ψ = 0 keeps them in the plane.

    Returns
    -------
    The eigenvalue in units of 4π²B/L: negative where the rod buckles out of its plane.
    """
    grid = _Grid(rod)
    theta, y = rod.nodal_angles(z, p), rod.scalars(z, p)
    fields = rod.fine_fields(theta, y)
    forces = grid.forces(y, fields)
    mesh = rod.model.mesh
    fine = Mesh(mesh.breaks, grid.reference)
    twist, bend = (
        at_nodes(profile(value, name), fine) * rod.model.fine.rigidity
        for name, value in (("torsion", stiffness.torsion), ("lateral", stiffness.lateral))
    )
    matrix = grid.assemble(twist, bend, fields, forces)
    basis = grid.admissible(ends)
    mass = np.tile(mesh.weights, 2)
    metric = basis.T @ (mass[:, None] * basis)
    half = np.linalg.inv(np.linalg.cholesky(metric))
    turned = basis @ half.T
    reduced = np.einsum("ia,lij,jb->lab", turned, matrix, turned, optimize=True)
    return np.asarray(np.linalg.eigvalsh(reduced)[:, 0])


class _Grid:
    """Values and slopes of φ and ψ at the nodes of the finer rule."""

    def __init__(self, rod: GeneralMechanics) -> None:
        model, mesh = rod.model, rod.model.mesh
        self.model, self.mesh = model, mesh
        self.reference = rod.fine_reference
        coarse = mesh.reference
        spread = legendre.legvander(2.0 * self.reference.nodes - 1.0, coarse.degree)
        self.values = spread @ coarse.to_legendre
        self.slopes = self.values @ coarse.derivative
        self.weights = mesh.lengths[:, None] * self.reference.weights

    def forces(
        self, y: Float[np.ndarray, "lanes scalars"], fields: Float[np.ndarray, "lanes e 5 fine"]
    ) -> tuple[Fine, Fine]:
        """Thrust and shear force M'."""
        along = np.einsum("lj,jei->lei", y, self.model.fine.along)
        across = np.einsum("lj,jei->lei", y, self.model.fine.across)
        pressure = np.einsum("lj,j->l", y, self.model.pressure)
        theta, x, height = fields[:, :, 0], fields[:, :, 2], fields[:, :, 3]
        if pressure.any():
            middle = [0.5 * (f[:, :1, :1] + f[:, -1:, -1:]) for f in (x, height)]
            along = along - pressure[:, None, None] * (height - middle[1])
            across = across + pressure[:, None, None] * (x - middle[0])
        c, s = np.cos(theta), np.sin(theta)
        return along * c + across * s, across * c - along * s

    def assemble(
        self, twist: Float[np.ndarray, "e fine"], bend: Float[np.ndarray, "e fine"],
        fields: Float[np.ndarray, "lanes e 5 fine"], forces: tuple[Fine, Fine],
    ) -> Float[np.ndarray, "lanes n n"]:  # fmt: skip
        """Matrix of the second variation in (φ, ψ) at the nodes."""
        kappa, moment = fields[:, :, KAPPA], fields[:, :, MOMENT]
        thrust, shear = forces
        lanes, nodes = len(kappa), len(self.mesh.nodes)
        out = np.zeros((lanes, 2, 2, nodes, nodes))
        lengths = self.mesh.lengths[:, None]
        pairs = {  # coefficients of (value, slope) pairs: φφ, φφ', φ'φ', …
            (0, 0, 0, 0): bend * kappa**2 - moment * kappa,
            (0, 1, 0, 1): twist / lengths**2 + 0.0 * kappa,
            (1, 0, 1, 0): twist * kappa**2 - moment * kappa - thrust,
            (1, 1, 1, 1): bend / lengths**2 + 0.0 * kappa,
            (0, 0, 1, 1): (bend * kappa - 0.5 * moment) / lengths,
            (0, 1, 1, 0): (0.5 * moment - twist * kappa) / lengths,
            (0, 0, 1, 0): 0.5 * shear,
        }
        tables = (self.values, self.slopes)
        for (f, df, g, dg), coefficient in pairs.items():
            local = np.einsum(
                "lei,ij,ik->lejk", coefficient * self.weights, tables[df], tables[dg],
                optimize=True,
            )  # fmt: skip
            for e, at in enumerate(self.mesh.element_nodes):
                out[:, f, g, at[:, None], at] += local[:, e]
                if (f, df) != (g, dg):
                    out[:, g, f, at[:, None], at] += local[:, e].transpose(0, 2, 1)
        return out.transpose(0, 1, 3, 2, 4).reshape(lanes, 2 * nodes, 2 * nodes)

    def admissible(self, ends: tuple[End, End]) -> Float[np.ndarray, "n m"]:
        """Orthonormal basis of the rotations that supports allow."""
        nodes = len(self.mesh.nodes)
        rows = []
        placed = [not (end.x == FREE and end.y == FREE) for end in ends]
        for end, place, node in zip(ends, placed, (0, nodes - 1), strict=True):
            if place or end.angle != FREE:
                rows += [np.eye(2 * nodes)[node], np.eye(2 * nodes)[nodes + node]]
        if all(placed):
            rows.append(np.concatenate([np.zeros(nodes), self.mesh.weights]))
        _, _, directions = np.linalg.svd(np.array(rows).reshape(-1, 2 * nodes))
        return np.ascontiguousarray(directions[len(rows) :].T)


def clearance(rod: Measured, apart: float) -> Descriptor:
    """Smallest distance between points that lie `apart` or further along the rod."""
    number = float(apart) if isinstance(apart, int | float) else np.nan
    if not 0.0 < number < 1.0:
        raise InputError(
            f"`apart` must be a share of the rod's length between 0 and 1; got {apart!r}."
        )
    unit = rod.units.value("length")

    def found(z: Lanes, p: Parameters) -> tuple[Values, Values]:
        return closest_approach(rod.mechanics.fields(z, p, stations()), number)

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * found(z, p)[0]

    def place(z: Lanes, p: Parameters) -> Values:
        return found(z, p)[1]

    name, label = f"clearance({number:.9g})", rod.units.label("length")
    return Descriptor(name, label, value, "clearance", rod.signature, place)


def lateral(
    rod: Measured, mechanics: GeneralMechanics, ends: tuple[End, End], stiffness: LateralStiffness
) -> Descriptor:
    """Smallest eigenvalue for movements out of the plane.

    `mechanics`: the rod's, in its parameters and any number of further ones that are zero.
    """
    unit = rod.units.value("couple")

    def value(z: Lanes, p: Parameters) -> Values:
        more = np.zeros((len(p), len(mechanics.model.names) - p.shape[1]))
        wide = np.concatenate([p, more], axis=1)
        return unit * lateral_margin(mechanics, ends, stiffness, z, wide)

    label = rod.units.label("couple")
    written = f"lateral_margin({stiffness.torsion}, {stiffness.lateral})"
    return Descriptor(written, label, value, "lateral margin", rod.signature)
