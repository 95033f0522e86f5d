"""The Lagrangian of a rod as constant arrays, and as its kernels read them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import ClassVar

import numpy as np

from equimorph.arrays import Bool, Float, Int
from equimorph.structures.rod.discretisation import Mesh, reference_element
from equimorph.structures.rod.ends import FREE, HELD, Axis, End, support_axes
from equimorph.structures.rod.lagrangian import (
    RodLagrangian,
    SupportEnergy,
    map_rows,
    support_energy,
)
from equimorph.structures.rod.pressure import closing
from equimorph.structures.rod.profiles import LoadShape, at_nodes
from equimorph.structures.rod.terms import Effects, Term
from equimorph.structures.rod.units import FOUR_PI_SQUARED

Rows = Float[np.ndarray, "scalars elements order"]


@dataclass(frozen=True, eq=False)
class Build:
    """What a general rod is made of, in non-dimensional form.

    terms: what each amplitude scales, by name, in the order of the parameters; length: that of the
    rod in the user's unit, in which the offsets of tendons are given.
    """

    mesh: Mesh
    ends: tuple[End, End]
    stiffness: LoadShape
    curvature: LoadShape
    axial: LoadShape | None
    terms: Mapping[str, Sequence[Term]]
    length: float = 1.0


@dataclass(frozen=True, eq=False)
class Densities:
    """Fields that a state is a combination of, at nodes of one rule in every element.

    Rows belong to the scalars. The force on the cross-section is (−b, −a): ``b = Σ y along``,
    ``a = Σ y across``; the moment is ``rigidity · κ − Σ y bending``; cables pull along the axis of
    a stretchable rod with ``Σ y tension``, and stiffen every rod against twist by ``Σ y torsion``.
    """

    along: Rows
    across: Rows
    bending: Rows
    tension: Rows
    torsion: Rows
    rigidity: Float[np.ndarray, "elements order"]
    softness: Float[np.ndarray, "elements order"]

    def map_scalars(self, matrix: Float[np.ndarray, "scalars others"]) -> "Densities":
        """The densities for new scalars ``y``, of which the present ones are ``matrix @ y``."""
        rows = ("along", "across", "bending", "tension", "torsion")
        return replace(self, **{each: map_rows(matrix, getattr(self, each)) for each in rows})


@dataclass(frozen=True, eq=False)
class RodModel(RodLagrangian):
    """The Lagrangian of a rod in its nodal angles θ and *scalars* y = (multipliers, parameters, 1).

    ``L = ½ θᵀKθ − θ·(slope y) + Σ (N − ½ γ (N + T)²) + ½ yᵀ Q y − p V`` with the sum over the nodes
    of every element, ``N = A sin θ + B cos θ``, ``A = m · across y``, ``B = m · along y``,
    ``T = m · tension y`` of cables, quadrature weights m, and V of `pressure.EnclosedArea`. N/m is
    the compressive force and γ the axial compliance over m: a stretchable rod's strain is
    eliminated node by node. Prescribed end angles are ``turned y``.
    """

    rows: ClassVar[tuple[str, ...]] = ("slope", "element_slope")
    last: ClassVar[tuple[str, ...]] = ("turned", "rest", "pressure")

    stiffness: Float[np.ndarray, "elements order order"]
    """Element matrices, with springs at the ends; `bending_stiffness` without."""
    bending_stiffness: Float[np.ndarray, "elements order order"]
    nodal: Densities
    fine: Densities
    slope: Float[np.ndarray, "scalars nodes"]
    """Coefficients of the angles, couples included; `element_slope` without, by element."""
    element_slope: Rows
    turned: Float[np.ndarray, "2 scalars"]
    springs: Float[np.ndarray, "2"]
    rest: Float[np.ndarray, "2 scalars"]
    """Stiffness of springs at the ends' angles, and where they are at rest."""
    pressure: Float[np.ndarray, " scalars"]
    """p, on the enclosed area V."""
    closing: Float[np.ndarray, "2 2"]
    """Q of V, see `pressure.closing`."""

    @cached_property
    def sine(self) -> Float[np.ndarray, "scalars points"]:
        """Coefficients of sin θ at the nodes of every element."""
        rows = self.mesh.element_weights * self.nodal.across
        return np.ascontiguousarray(rows.reshape(self.scalars, -1))

    @cached_property
    def cosine(self) -> Float[np.ndarray, "scalars points"]:
        """Coefficients of cos θ."""
        rows = self.mesh.element_weights * self.nodal.along
        return np.ascontiguousarray(rows.reshape(self.scalars, -1))

    @cached_property
    def tension(self) -> Float[np.ndarray, "scalars points"]:
        """Coefficients of the cables' pull along the axis."""
        rows = self.mesh.element_weights * self.nodal.tension
        return np.ascontiguousarray(rows.reshape(self.scalars, -1))

    @cached_property
    def softness(self) -> Float[np.ndarray, " points"]:
        """γ: axial compliance over the quadrature weight."""
        return np.ascontiguousarray((self.nodal.softness / self.mesh.element_weights).ravel())

    def map_scalars(
        self, names: Sequence[str], matrix: Float[np.ndarray, "scalars others"]
    ) -> "RodModel":
        """The same rod in new parameters ``y``, of which its scalars are ``matrix @ y``."""
        nodal, fine = (each.map_scalars(matrix) for each in (self.nodal, self.fine))
        return replace(super().map_scalars(names, matrix), nodal=nodal, fine=fine)


def raw_names(ends: tuple[End, End], terms: Mapping[str, Sequence[Term]]) -> tuple[str, ...]:
    """Parameters of a rod before coordinates are chosen: angles, amplitudes, span, rise."""
    sides = zip(("theta_A", "theta_B"), ends, strict=True)
    angles = [name for name, end in sides if end.angle != FREE]
    places = [axis.name for axis in support_axes(ends) if axis.opposed]
    return (*angles, *terms, *places)


def raw_model(build: Build) -> RodModel:
    """Arrays of a rod in the parameters of `raw_names`."""
    mesh, ends = build.mesh, build.ends
    names = raw_names(ends, build.terms)
    axes = support_axes(ends)
    m = sum(axis.opposed for axis in axes)
    place = {name: m + i for i, name in enumerate(names)}
    count = m + len(names) + 1
    fine = Mesh(mesh.breaks, reference_element(max(20, 2 * mesh.degree)))
    nodal, finer = (_densities(build, grid, axes, place, count) for grid in (mesh, fine))
    unit = mesh.reference.derivative / mesh.lengths[:, None, None]
    weighted = mesh.element_weights * nodal.rigidity
    bending = np.einsum("eki,ek,ekj->eij", unit, weighted, unit)
    bending = 0.5 * (bending + bending.transpose(0, 2, 1))
    element_slope = np.einsum("eki,ek,jek->jei", unit, mesh.element_weights, nodal.bending)
    slope = np.zeros((count, len(mesh.nodes)))
    for e, nodes in enumerate(mesh.element_nodes):
        slope[:, nodes] += element_slope[:, e]
    natural = np.zeros_like(nodal.bending)
    natural[-1] = at_nodes(build.curvature, mesh)
    forces, pressure = np.zeros((count, 2)), np.zeros(count)
    for name, terms in build.terms.items():
        row, effects = place[name], _sum_effects(terms, mesh)
        natural[row], forces[row], pressure[row] = effects.natural, effects.force, effects.pressure
        for s, moment in effects.couples:
            slope[row, int(np.argmin(np.abs(mesh.nodes - s)))] += moment
    supports = _supports(build, axes, place, forces)
    # ∫ B κ_j κ_k of the intrinsic curvatures is the energy of a straight rod
    quadratic = supports.quadratic + np.einsum("jei,ei,kei->jk", natural, weighted, natural)
    stiffness, springs = bending.copy(), np.zeros(2)
    turned, rest = np.zeros((2, 2, count))
    for side, (name, node) in enumerate((("theta_A", 0), ("theta_B", -1))):
        angle = ends[side].angle
        if angle == HELD:
            turned[side, place[name]] = 1.0
        elif angle != FREE:
            springs[side], rest[side, place[name]] = float(angle), 1.0
            stiffness[node, node, node] += float(angle)
            slope[place[name], node] += float(angle)
            quadratic[place[name], place[name]] += float(angle)
    return RodModel(
        mesh=mesh,
        names=names,
        multipliers=m,
        held=(ends[0].angle == HELD, ends[1].angle == HELD),
        quadratic=quadratic,
        reaction=supports.reaction,
        origin=supports.origin,
        from_start=supports.from_start,
        springs_along=supports.springs,
        stiffness=stiffness,
        bending_stiffness=bending,
        nodal=nodal,
        fine=finer,
        slope=slope,
        element_slope=element_slope,
        turned=turned,
        springs=springs,
        rest=rest,
        pressure=pressure,
        closing=closing(
            (_moves(axes, 0), _moves(axes, 1)), float(np.arctan2(axes[0].unit[1], axes[0].unit[0]))
        ),
    )


def _moves(axes: Sequence[Axis], side: int) -> list[int]:
    """Axes along which an end may move."""
    return [at for at, axis in enumerate(axes) if (axis.first, axis.last)[side] != HELD]


def _sum_effects(terms: Sequence[Term], mesh: Mesh) -> Effects:
    """Effects of several terms with one amplitude."""
    parts = [term.effects(mesh) for term in terms]
    zero = np.zeros((mesh.elements, mesh.degree + 1))
    fields = ("along", "across", "bending", "natural", "tension", "torsion")
    return Effects(
        **{each: sum((getattr(part, each) for part in parts), zero) for each in fields},
        couples=tuple(couple for part in parts for couple in part.couples),
        pressure=sum(part.pressure for part in parts),
        force=(sum(part.force[0] for part in parts), sum(part.force[1] for part in parts)),
    )


def _densities(
    build: Build, mesh: Mesh, axes: Sequence[Axis], place: Mapping[str, int], count: int
) -> Densities:
    """Rows of all scalars on a mesh with the elements of the rod."""
    rigidity = at_nodes(build.stiffness, mesh) / FOUR_PI_SQUARED
    shape = (5, count, mesh.elements, mesh.degree + 1)
    along, across, bending, tension, torsion = np.zeros(shape)
    for c, axis in enumerate(each for each in axes if each.opposed):
        along[c], across[c] = axis.unit
    bending[-1] = rigidity * at_nodes(build.curvature, mesh)
    for name, terms in build.terms.items():
        effects, row = _sum_effects(terms, mesh), place[name]
        # a free end B takes no load: what lies beyond a cross-section hangs on end A
        hung = sum(
            (np.dot(effects.force, axis.unit) * np.array(axis.unit) for axis in axes
             if axis.last == FREE), np.zeros(2),
        )  # fmt: skip
        along[row], across[row] = effects.along - hung[0], effects.across - hung[1]
        bending[row] = effects.bending + rigidity * effects.natural
        # amplitudes of tendons are tensions times the unit of their offsets
        tension[row] = 0.0 if build.axial is None else effects.tension * build.length
        torsion[row] = effects.torsion / build.length
    softness = np.zeros_like(rigidity)
    if build.axial is not None:
        softness = 1.0 / at_nodes(build.axial, mesh)
    return Densities(along, across, bending, tension, torsion, rigidity, softness)


def _supports(
    build: Build,
    axes: Sequence[Axis],
    place: Mapping[str, int],
    forces: Float[np.ndarray, "scalars 2"],
) -> SupportEnergy:
    """Energy of the supports; the rod begins at the end that does not slide."""
    out = support_energy(axes, forces, place)
    if build.ends[0].slide is None:
        return out
    site = np.zeros(len(forces))  # end B, whose place across the line is given
    site[place[axes[1].name]] = 1.0
    return replace(out, origin=np.outer(axes[1].unit, site), from_start=(False, False))


@dataclass(frozen=True, eq=False)
class Packed:
    """Nonzero coefficients of the scalars, packed for every point."""

    points: Float[np.ndarray, "points many"]
    """For the nodes of every element the coefficients of sin θ, of cos θ and of the cables' pull.
    The multipliers come first in each of the first two groups."""
    slope: Float[np.ndarray, "nodes few"]
    """Coefficients of θ at every node of the rod."""
    picks: Int[np.ndarray, " all"]
    """Which scalars all these belong to, group by group."""
    splits: Int[np.ndarray, "3"]
    """Where the second, third and fourth group begin in `picks`."""


def pack_tables(model: RodModel) -> Packed:
    """Tables of a rod."""
    m, tables = model.multipliers, (model.sine, model.cosine, model.tension, model.slope)
    used: list[Bool[np.ndarray, " scalars"]] = [np.asarray(a.any(axis=1)) for a in tables]
    for each in used[:2]:
        each[:m] = True
    picks = [np.flatnonzero(each) for each in used]
    groups = [table[pick].T for table, pick in zip(tables, picks, strict=True)]
    return Packed(
        np.ascontiguousarray(np.concatenate(groups[:3], axis=1)),
        np.ascontiguousarray(groups[3]),
        np.concatenate(picks),
        np.cumsum([len(pick) for pick in picks[:3]]),
    )
