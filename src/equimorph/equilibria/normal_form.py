"""Criticality of branch points from the normal form of the reduced energy."""

import numpy as np
from jaxtyping import Float

from equimorph.equilibria.curves import ParameterLine

Lanes = Float[np.ndarray, "lanes size"]
Values = Float[np.ndarray, " lanes"]

TRANSCRITICAL = 1e-4
"""Size of the quadratic coefficient, relative to the cubic one, that counts as not zero."""


def criticality(curve: ParameterLine, z: Lanes, t: Values) -> list[str]:
    """Classify simple branch points: "subcritical", "supercritical" or "transcritical".

    Lyapunov–Schmidt reduction with the null vector φ, |φ| = 1 in the metric: the reduced equation
    is ``σ' τ ξ + ½ b ξ² + c ξ³/6 = 0`` with ``b = φᵀF_zz[φ, φ]`` and
    ``c = φᵀF_zzz[φ, φ, φ] − 3 φᵀF_zz[φ, w]``, ``F_z w = F_zz[φ, φ]``, ``w ⊥ φ``. Side branches of
    a pitchfork are stable where the main path is not if c > 0 (supercritical). The third derivative
    is a central difference of F_zz, good to 1e-8.
    """
    structure, p = curve.structure, curve.parameters(t)
    n, none_p = structure.unknowns, np.zeros_like(p)
    phi = _null_vector(curve, z, t)
    norm = np.sqrt(phi[:, :n] ** 2 @ structure.mass)
    phi = phi / norm[:, None]

    def second(at: Lanes) -> Lanes:
        return structure.second_derivative(at, p, (phi, none_p), (phi, none_p))

    twice = second(z)
    quadratic = np.einsum("li,li->l", phi, twice)
    h = 1e-4
    third = np.einsum("li,li->l", phi, second(z + h * phi) - second(z - h * phi)) / (2 * h)
    unit = phi / np.linalg.norm(phi, axis=1, keepdims=True)
    rhs = np.zeros((len(z), 1, structure.size + 1))
    rhs[:, 0, :-1] = twice
    border = (unit[:, None], unit[:, None], np.zeros((len(z), 1, 1)))
    w = np.ascontiguousarray(structure.solve(z, p, rhs, border).x[:, 0, :-1])
    inner = structure.second_derivative(z, p, (phi, none_p), (w, none_p))
    cubic = third - 3.0 * np.einsum("li,li->l", phi, inner)
    skew = np.abs(quadratic) > TRANSCRITICAL * np.maximum(np.abs(cubic), 1.0)
    return [
        "transcritical" if s else ("supercritical" if c > 0 else "subcritical")
        for s, c in zip(skew, cubic, strict=True)
    ]


def _null_vector(curve: ParameterLine, z: Lanes, t: Values) -> Lanes:
    """Null vector of F_z by bordered solves that stay regular at the singular point."""
    structure, p = curve.structure, curve.parameters(t)
    b = np.tile(np.cos(1.3 * np.arange(z.shape[1])) + 1.1, (len(z), 1))
    for _ in range(4):
        b = b / np.linalg.norm(b, axis=1, keepdims=True)
        rhs = np.zeros((len(z), 1, structure.size + 1))
        rhs[:, 0, -1] = 1.0
        border = (b[:, None], b[:, None], np.zeros((len(z), 1, 1)))
        b = np.ascontiguousarray(structure.solve(z, p, rhs, border).x[:, 0, :-1])
    return np.asarray(b / np.linalg.norm(b, axis=1, keepdims=True))
