"""Stability of a rod out of its plane: descriptors, and whether it snaps on leaving its plane."""

from dataclasses import dataclass
from functools import partial

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Descriptor, Vanishing
from equimorph.structures.rod.lateral import Coefficients, Movements, OutOfPlane
from equimorph.structures.rod.planar_fields import Measured
from equimorph.structures.rod.terms import Couple, Pressure, Term

Points = Float[np.ndarray, "lanes elements order"]

DEGENERATE = 1e-6
"""Quartic coefficient, relative to its two parts, below which its sign is not trusted."""
SUPERCRITICAL, SUBCRITICAL, NOT_JUDGED = "supercritical", "subcritical", "not judged"


@dataclass(frozen=True, eq=False)
class _Movement:
    """A movement at the nodes of every element, with the strains and thrusts that it makes.

    With r² = φ² + ψ² and h = κ r² + φψ' − ψφ' a rotation R → R exp[a (φ t + ψ n)] changes strains
    and tangent by::

        twist        a (φ' − κψ) + a³ ψ h/6          lateral   a (ψ' + κφ) − a³ φ h/6
        in the plane  − a² h/2 + a⁴ r² h/24
        t → (1 − a² ψ²/2 + a⁴ ψ² r²/24) t + (a² φψ/2 − a⁴ φψ r²/24) n − (a ψ − a³ ψ r²/6) b
    """

    phi: Points
    psi: Points
    twisted: Points
    bent: Points
    """First-order strains."""
    square: Points
    wedge: Points
    """r² and h."""
    second: Points
    fourth: Points
    """Thrust of second and fourth order, that of the closure's force included."""

    @classmethod
    def of(cls, block: OutOfPlane, at: Coefficients, x: Movements) -> "_Movement":
        """Movement of nodal φ, ψ and the closure's force."""
        n, nodes = block.unknowns, block.mesh.element_nodes
        phi, psi = x[:, 0:n:2][:, nodes], x[:, 1:n:2][:, nodes]
        d_phi, d_psi = (np.einsum("eij,lej->lei", block.slopes, f) for f in (phi, psi))
        force = x[:, n:].sum(axis=1)[:, None, None]
        square = phi**2 + psi**2
        turned = psi**2 * at.thrust - phi * psi * at.shear
        return cls(
            phi,
            psi,
            d_phi - at.kappa * psi,
            d_psi + at.kappa * phi,
            square,
            at.kappa * square + phi * d_psi - psi * d_phi,
            force * psi - 0.5 * turned,
            square * (turned / 24.0 - force * psi / 6.0),
        )


def criticality(block: OutOfPlane, z: Lanes, p: Parameters) -> list[str]:
    """Whether the states out of the plane that begin at lateral branch points are stable at first.

    On the branch the energy is ``E₀ + a⁴ (L₄ − ½ g·F_z⁻¹ g)``: L₄ of the mode alone, g the planar
    forces of second order, which the planar unknowns balance. Positive: "supercritical", the rod
    moves out of its plane quasi-statically; negative: "subcritical", it snaps. "not judged" where
    the sum almost vanishes or is not a number, as at a planar fold.
    """
    value, size = quartic(block, z, p)
    with np.errstate(invalid="ignore"):
        sure = np.abs(value) > DEGENERATE * size
    words = np.where(value > 0.0, SUPERCRITICAL, SUBCRITICAL)
    return [str(word) for word in np.where(sure, words, NOT_JUDGED)]


def quartic(block: OutOfPlane, z: Lanes, p: Parameters) -> tuple[Values, Values]:
    """Coefficient of a⁴ in the energy along the mode with ∫ φ² + ψ² = 1, and the size of its parts.

    Units: 4π²B/L.
    """
    at = block.coefficients(z, p)
    move = _Movement.of(block, at, block.mode(z, p))
    weights, rigidity = block.mesh.element_weights, block.model.nodal.rigidity
    strain = at.torsion * move.psi * move.twisted - at.lateral * move.phi * move.bent
    density = move.wedge * (strain / 6.0 + rigidity * move.wedge / 8.0)
    density += at.moment * move.square * move.wedge / 24.0
    density += at.stretch * move.fourth - 0.5 * block.model.nodal.softness * move.second**2
    alone = (weights * density).sum(axis=(1, 2))
    force = _planar_force(block, at, move, z, p)
    balanced = 0.5 * np.einsum("li,li->l", force, block.rod.solve(z, p, force[:, None]).x[:, 0])
    return alone - balanced, np.abs(alone) + np.abs(balanced)


def _planar_force(
    block: OutOfPlane, at: Coefficients, move: _Movement, z: Lanes, p: Parameters
) -> Lanes:
    """Change of the second-order energy of a movement with the planar unknowns and multipliers."""
    model, nodes, n = block.model, block.mesh.element_nodes, block.rod.unknowns
    weights, soft = block.mesh.element_weights, model.nodal.softness
    bend = at.lateral * move.phi * move.bent - at.torsion * move.psi * move.twisted
    bend -= 0.5 * (model.nodal.rigidity * move.wedge + at.moment * move.square)
    product = move.phi * move.psi

    def by_force(thrust: Points, shear: Points) -> Points:
        second = 0.5 * (product * shear - move.psi**2 * thrust)
        return np.asarray(weights * (at.stretch * second - soft * move.second * thrust))

    turn = by_force(at.shear, -at.thrust)
    turn += np.einsum("lek,eki->lei", weights * bend, block.slopes)
    nodal = np.zeros((len(z), len(block.mesh.nodes)))
    for e, where in enumerate(nodes):
        nodal[:, where] += turn[:, e]
    theta = block.rod.nodal_angles(z, p)[:, nodes]
    c, s = np.cos(theta), np.sin(theta)
    out = np.zeros_like(z)
    out[:, :n] = nodal[:, block.rod.unknown_nodes]
    for j in range(model.multipliers):
        along, across = model.nodal.along[j], model.nodal.across[j]
        parts = by_force(along * c + across * s, across * c - along * s)
        out[:, n + j] = parts.sum(axis=(1, 2))
    return out


LATERAL_BRANCH_POINT = "lateral branch point"
"""The event where a planar state begins to leave its plane."""


@dataclass(frozen=True, eq=False)
class LateralMode:
    """The movement out of the plane that a state resists least.

    Parameters
    ----------
    margin
        Its eigenvalue, in the unit of couples; negative where the rod leaves its plane.
    s
        Arclengths, as shares of the length.
    twist, turn
        Small rotations φ about the tangent and ψ about the normal, with ∫ φ² + ψ² ds = 1.
    z
        Sideways displacement −∫ψ, in the unit of lengths; positive in the middle.
    """

    margin: float
    s: Float[np.ndarray, " points"]
    twist: Float[np.ndarray, " points"]
    turn: Float[np.ndarray, " points"]
    z: Float[np.ndarray, " points"]


def lateral_mode(
    rod: Measured, block: OutOfPlane, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]
) -> LateralMode:
    """Mode of one state at arclengths."""
    x, mesh, n = block.mode(z, p)[0], block.mesh, block.unknowns
    phi, psi, stretch = x[0:n:2], x[1:n:2], np.empty(len(mesh.nodes))
    stretch[mesh.element_nodes] = block.coefficients(z, p).stretch[0]
    sideways = -mesh.integration(np.append(s, 1.0)) @ (stretch * psi)
    sideways -= 0.0 if block.holding.from_start else sideways[-1]
    margin = float(block.margin(z, p)[0]) * rod.units.value("couple")
    values, length = mesh.interpolation(s), rod.units.value("length")
    return LateralMode(margin, s, values @ phi, values @ psi, length * sideways[:-1])


def check_terms(terms: dict[str, tuple[Term, ...]]) -> None:
    """Refuse loads that have no potential in space, such as pressure."""
    for name, acting in terms.items():
        if any(isinstance(term, Pressure) for term in acting):
            raise InputError(
                f"`torsion`, `lateral` must be left out for rods under the pressure `{name}`: on a "
                "curve in space pressure has no potential, so that leaving the plane is not "
                "judged. Use a dead line load."
            )


def lateral_index(rod: Measured, block: OutOfPlane, written: str) -> Descriptor:
    """Number of independent movements out of the plane that lower the energy."""

    def value(z: Lanes, p: Parameters) -> Values:
        return block.index(z, p).astype(float)

    return Descriptor(f"lateral_index{written}", "1", value, "lateral index", rod.signature)


def lateral_margin(
    rod: Measured, block: OutOfPlane, written: str, terms: dict[str, tuple[Term, ...]]
) -> Descriptor:
    """Smallest eigenvalue of the second variation for movements out of the plane."""
    unit = rod.units.value("couple")
    couples = any(isinstance(term, Couple) for acting in terms.values() for term in acting)

    def value(z: Lanes, p: Parameters) -> Values:
        return unit * block.margin(z, p)

    def not_judged(z: Lanes, p: Parameters) -> list[str]:
        return [NOT_JUDGED] * len(z)

    # beyond second order, what a couple inside the rod does in space is nobody's convention
    critical = not_judged if couples else partial(criticality, block)
    return Descriptor(
        f"lateral_margin{written}",
        rod.units.label("couple"),
        value,
        "lateral margin",
        rod.signature,
        vanishing=Vanishing(LATERAL_BRANCH_POINT, critical),
    )


def number_or_text(part: str) -> float | str:
    """Stiffness as a number, or as a text with its unit."""
    try:
        return float(part)
    except ValueError:
        return part
