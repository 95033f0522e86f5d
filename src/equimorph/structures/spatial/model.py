"""The Lagrangian of a rod in space as constant arrays."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import ClassVar

import numpy as np

from equimorph.arrays import Float
from equimorph.errors import InputError
from equimorph.structures.rod import terms
from equimorph.structures.rod.discretisation import Mesh
from equimorph.structures.rod.ends import FREE
from equimorph.structures.rod.lagrangian import RodLagrangian, support_energy
from equimorph.structures.rod.profiles import LoadShape, at_nodes, inside
from equimorph.structures.rod.terms import Term
from equimorph.structures.rod.units import FOUR_PI_SQUARED
from equimorph.structures.spatial.ends import Ends, support_axes

AXES = "tnb"
"""Axes of the cross-section: tangent, normal in the plane of a planar rod, binormal."""


@dataclass(frozen=True, eq=False)
class SpatialEffects:
    """What a term of amplitude 1 does."""

    force: Float[np.ndarray, "elements order 3"]
    """Load cumulated from end A, and `total` all of it."""
    total: Float[np.ndarray, "3"]
    moment: Float[np.ndarray, "elements order 3"]
    """Part of the moment, on the axes of the cross-section, that does not come from strains."""
    natural: Float[np.ndarray, "elements order 3"]
    """Intrinsic strains: twist, curvatures about n and b."""
    tension: Float[np.ndarray, "elements order"]
    torsion: Float[np.ndarray, "elements order"]
    """Pull of cables along the rod, and the torsional stiffness that they give it."""

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
    """Refuse what has no potential in space: couples and pressure."""
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


ANGLES = ("theta", "tilt", "twist")
"""Angles a, b, τ of a clamp R = exp(e₃ a) exp(e₂ b) exp(e₁ τ); with _A or _B, its parameters."""
Rows = Float[np.ndarray, "scalars elements order 3"]
Row = Float[np.ndarray, "scalars elements order"]


@dataclass(frozen=True, eq=False)
class Build:
    """What a rod in space is made of, in non-dimensional form."""

    mesh: Mesh
    ends: Ends
    stiffness: LoadShape
    """In the plane; `ratios` are those against twist and out of the plane to it."""
    ratios: tuple[LoadShape, LoadShape]
    natural: tuple[LoadShape, LoadShape, LoadShape]
    """Intrinsic strains: twist, curvatures about n and b."""
    axial: LoadShape | None
    shear: tuple[LoadShape, LoadShape] | None
    """Stiffnesses against extension and, along n and b, against shear; None: rigid."""
    terms: Mapping[str, Sequence[Term]]
    """What each amplitude scales, by name, in the order of the parameters."""
    length: float = 1.0
    """That of the rod in the user's unit, in which the offsets of tendons are given."""


@dataclass(frozen=True, eq=False)
class SpatialModel(RodLagrangian):
    """The Lagrangian of a rod in its rotations q and *scalars* y = (multipliers, parameters, 1).

    ``L = Σ m (½ u·(K + τ e₁e₁ᵀ) u − u·b + a₁ − ½ γ₁ (a₁ + T)² − ½ γ₂ a₂² − ½ γ₃ a₃²) + ½ yᵀ Q y``
    over the nodes of every element with quadrature weights m. u: twist and curvatures about n and b
    from the rotations; a: the force ``f = Σ y force`` on the cross-section, on its axes t, n, b;
    ``b = Σ y moment``, ``T = Σ y tension``, ``τ = Σ y torsion``; γ: compliances against extension
    and shear, whose strains are eliminated at the nodes.
    """

    rows: ClassVar[tuple[str, ...]] = ("force", "moment", "tension", "torsion")
    last: ClassVar[tuple[str, ...]] = ("turned",)

    stiffness: Float[np.ndarray, "elements order 3"]
    """K: diagonal, against twist and bending about n and b."""
    softness: Float[np.ndarray, "elements order 3"]
    """γ."""
    force: Rows
    moment: Rows
    tension: Row
    torsion: Row
    turned: Float[np.ndarray, "2 3 scalars"]
    """Angles (a, b, τ) of clamps A and B as combinations of the scalars."""

    @cached_property
    def soft(self) -> bool:
        """Whether the rod stretches or shears."""
        return bool(self.softness.any())

    @property
    def unknown_nodes(self) -> slice:
        """Nodes whose rotations are unknown."""
        count = len(self.mesh.nodes)
        return slice(int(self.held[0]), count - int(self.held[1]))


def raw_names(ends: Ends, terms: Mapping[str, Sequence[Term]]) -> tuple[str, ...]:
    """Parameters of a rod before coordinates are chosen: angles, amplitudes, places."""
    angles = [
        f"{angle}_{side}"
        for side, end in zip("AB", ends, strict=True)
        if not end.turns
        for angle in ANGLES
    ]
    places = [axis.name for axis in support_axes(ends) if axis.opposed]
    return (*angles, *terms, *places)


def raw_model(build: Build) -> SpatialModel:
    """Arrays of a rod in the parameters of `raw_names`."""
    mesh, ends = build.mesh, build.ends
    names, axes = raw_names(ends, build.terms), support_axes(ends)
    opposed = [axis for axis in axes if axis.opposed]
    m = len(opposed)
    place = {name: m + i for i, name in enumerate(names)}
    count = m + len(names) + 1
    stiffness, softness = _stiffnesses(build)
    total = {name: _sum_effects(terms, mesh) for name, terms in build.terms.items()}
    rows = np.zeros((2, count, mesh.elements, mesh.degree + 1, 3))
    (force, moment), (tension, torsion) = rows, np.zeros((2, *rows.shape[1:-1]))
    natural = np.zeros_like(moment)
    natural[-1] = np.stack([at_nodes(each, mesh) for each in build.natural], axis=-1)
    for c, axis in enumerate(opposed):
        force[c] = axis.unit
    for name, each in total.items():
        row = place[name]
        # a free end B takes no load: what lies beyond a cross-section hangs on end A
        hung = [axis.last == FREE for axis in axes] * each.total
        force[row], natural[row] = each.force - hung, each.natural
        moment[row] = each.moment
        # amplitudes of tendons are tensions times the unit of their offsets
        tension[row] = 0.0 if build.axial is None else each.tension * build.length
        torsion[row] = each.torsion / build.length
    moment += stiffness * natural
    weights = mesh.element_weights[..., None] * stiffness
    quadratic = np.einsum("jeik,eik,leik->jl", natural, weights, natural)
    loads = np.zeros((count, 3))
    for name, each in total.items():
        loads[place[name]] = each.total
    supports = support_energy(axes, loads, place)
    turned = np.zeros((2, 3, count))
    for side, end in enumerate(ends):
        if not end.turns:
            for k, angle in enumerate(ANGLES):
                turned[side, k, place[f"{angle}_{'AB'[side]}"]] = 1.0
    return SpatialModel(
        mesh=mesh,
        names=names,
        multipliers=m,
        held=(not ends[0].turns, not ends[1].turns),
        quadratic=quadratic + supports.quadratic,
        reaction=supports.reaction,
        origin=supports.origin,
        from_start=supports.from_start,
        springs_along=supports.springs,
        stiffness=stiffness,
        softness=softness,
        force=force,
        moment=moment,
        tension=tension,
        torsion=torsion,
        turned=turned,
    )


def _stiffnesses(
    build: Build,
) -> tuple[Float[np.ndarray, "elements order 3"], Float[np.ndarray, "elements order 3"]]:
    """K and γ at the nodes of every element."""
    mesh = build.mesh
    plane = at_nodes(build.stiffness, mesh) / FOUR_PI_SQUARED
    twist, aside = (plane * at_nodes(each, mesh) for each in build.ratios)
    softness = np.zeros((*plane.shape, 3))
    if build.axial is not None:
        softness[..., 0] = 1.0 / at_nodes(build.axial, mesh)
    if build.shear is not None:
        for k, each in enumerate(build.shear):
            softness[..., 1 + k] = 1.0 / at_nodes(each, mesh)
    return np.stack([twist, aside, plane], axis=-1), softness


def _sum_effects(terms: Sequence[Term], mesh: Mesh) -> SpatialEffects:
    """Effects of several terms with one amplitude."""
    out = SpatialEffects.none(mesh)
    for term in terms:
        for name, part in vars(effects(term, mesh)).items():
            getattr(out, name)[:] += part
    return out
