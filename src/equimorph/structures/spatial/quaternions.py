"""Unit quaternions, scalar part first, as rotations of cross-sections; and jets of their functions.

A cross-section has the rotation R with the columns t, n, b. Products act on the last axis.

A *jet* carries derivatives along: its first axis has one part (a value), two (value and derivative
along v), or four (value, along v, along w, and the mixed second derivative).
"""

from collections.abc import Callable

import numpy as np

from equimorph.arrays import Flags, Float, Int, Lanes

Quaternions = Float[np.ndarray, "... 4"]
Jet = Float[np.ndarray, "parts ..."]

LONGEST_STEP = 0.1
"""Length of Newton's steps from random guesses. The energy of bending is no quadratic function of
quaternions; see docs/decisions.md, "Newton's steps from random guesses are short in space"."""
LEAST = 1e-12
"""Length of a quaternion that has no direction."""

PAIRS: dict[int, tuple[tuple[tuple[int, int], ...], ...]] = {
    1: (((0, 0),),),
    2: (((0, 0),), ((0, 1), (1, 0))),
    3: (((0, 0),), ((0, 1), (1, 0)), ((0, 2), (2, 0))),
    4: (((0, 0),), ((0, 1), (1, 0)), ((0, 2), (2, 0)), ((0, 3), (1, 2), (2, 1), (3, 0))),
}
"""Parts of two factors whose products add up to each part of the product; 3: none is mixed."""


def product(a: Quaternions, b: Quaternions) -> Quaternions:
    """Product a b of quaternions."""
    a0, a1, a2, a3 = np.moveaxis(a, -1, 0)
    b0, b1, b2, b3 = np.moveaxis(b, -1, 0)
    return np.stack(
        [
            a0 * b0 - a1 * b1 - a2 * b2 - a3 * b3,
            a0 * b1 + a1 * b0 + a2 * b3 - a3 * b2,
            a0 * b2 - a1 * b3 + a2 * b0 + a3 * b1,
            a0 * b3 + a1 * b2 - a2 * b1 + a3 * b0,
        ],
        axis=-1,
    )


UNITS = np.eye(4)[1:]
"""e₁, e₂, e₃."""
RIGHT = np.stack([product(np.eye(4), unit).T for unit in UNITS])
"""q e_k is ``RIGHT[k] @ q``; each matrix is skew."""
LEFT = np.stack([product(unit, np.eye(4)).T for unit in UNITS])
"""e_k q is ``LEFT[k] @ q``."""
FRAME = np.zeros((3, 3, 4, 4))
"""Component c of column k of R is ``q · FRAME[k, c] @ q`` where |q| = 1."""
for _k in range(3):
    for _c in range(3):  # q e_k q* = (e_c q) · (q e_k)
        _matrix = LEFT[_c].T @ RIGHT[_k]
        FRAME[_k, _c] = 0.5 * (_matrix + _matrix.T)


def exponential(vectors: Float[np.ndarray, "... 3"]) -> Quaternions:
    """Rotations by rotation vectors."""
    half = 0.5 * np.linalg.norm(vectors, axis=-1, keepdims=True)
    return np.concatenate([np.cos(half), 0.5 * np.sinc(half / np.pi) * vectors], axis=-1)


def rotation_vectors(q: Quaternions) -> Float[np.ndarray, "... 3"]:
    """Rotation vectors of rotations, from −π to π: the shorter way round."""
    near = np.where(q[..., :1] < 0.0, -q, q)
    sine = np.linalg.norm(near[..., 1:], axis=-1, keepdims=True)
    angle = 2.0 * np.arctan2(sine, near[..., :1])
    rate = np.where(sine > 1e-12, angle / np.maximum(sine, 1e-300), 2.0)
    return np.asarray(rate * near[..., 1:])


def conjugate(q: Quaternions) -> Quaternions:
    """Inverse rotations."""
    return np.asarray(q * np.array([1.0, -1.0, -1.0, -1.0]))


def matrices(q: Quaternions) -> Float[np.ndarray, "... 3 3"]:
    """Rotation matrices, with the columns t, n, b."""
    return np.asarray(np.einsum("...a,kcab,...b->...ck", q, FRAME, q, optimize=True))


SMALLEST_PRODUCT = 0.5
"""Product of quaternions of neighbouring nodes, cos(φ/2), below which rotations jump."""


def are_near(q: Float[np.ndarray, "lanes elements order 4"]) -> Flags:
    """Whether neighbours in every element are turned by less than 120° against each other.

    Quaternions q and −q are one rotation. Polynomials that lead from one to the other between
    two nodes, through 0, or half of this way, are equilibria of elements of any size, since
    strains are measured at the nodes; no rod has such states.
    """
    product_of_neighbours = (q[:, :, 1:] * q[:, :, :-1]).sum(axis=-1)
    return np.asarray(product_of_neighbours.min(axis=(1, 2)) > SMALLEST_PRODUCT)


# --- jets -----------------------------------------------------------------------------------------


def bilinear(multiply: Callable[[np.ndarray, np.ndarray], np.ndarray], a: Jet, b: Jet) -> Jet:
    """Jet of a product that is linear in both factors."""
    return np.stack([sum(multiply(a[i], b[j]) for i, j in pairs) for pairs in PAIRS[len(a)]])


def compose(value: np.ndarray, first: np.ndarray, second: np.ndarray, inner: Jet) -> Jet:
    """Jet of f(x) for the jet of x, from f, f' and f'' at its value."""
    parts = [value, *(first * part for part in inner[1:])]
    if len(inner) == 4:
        parts[3] = parts[3] + second * inner[1] * inner[2]
    return np.stack(parts)


def turn_about(angle: Jet, axes: Float[np.ndarray, "... 3"]) -> Jet:
    """Quaternions exp(a φ/2) of angles about unit axes."""
    c, s = np.cos(0.5 * angle[0]), np.sin(0.5 * angle[0])
    out = np.zeros((*angle.shape, 4), angle.dtype)
    out[..., 0] = compose(c, -0.5 * s, -0.25 * c, angle)
    out[..., 1:] = compose(s, 0.5 * c, -0.25 * s, angle)[..., None] * axes
    return out


def clamp_rotation(angles: Float[np.ndarray, "parts ... 3"]) -> Jet:
    """Rotation exp(e₃ a/2) exp(e₂ b/2) exp(e₁ τ/2) of a clamp from its angles (a, b, τ)."""
    turns = [turn_about(angles[..., k], np.eye(3)[2 - k]) for k in range(3)]
    return bilinear(product, bilinear(product, turns[0], turns[1]), turns[2])


def dot(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products summed over the last axis."""
    return np.asarray((a * b).sum(axis=-1))


def apply(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Products of rows with vectors."""
    return np.asarray(np.einsum("...ka,...a->...k", a, b))


def combine(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Sums of rows with factors."""
    return np.asarray(np.einsum("...k,...ka->...a", a, b))


def strains(
    slopes: Float[np.ndarray, "elements order order"],
    q: Float[np.ndarray, "parts lanes elements order 4"],
) -> tuple[Jet, Jet, Jet]:
    """q e_k and q' at the nodes of every element, and the strains 2 (q e_k)·q'."""
    turned = np.einsum("kab,...b->...ka", RIGHT, q)
    moved = np.einsum("eij,pleja->pleia", slopes, q)
    return turned, moved, 2.0 * bilinear(apply, turned, moved)


def element_slopes(
    slopes: Float[np.ndarray, "elements order order"], turned: Jet, moved: Jet, moment: Jet
) -> Jet:
    """Gradient of a function of the strains by q at the nodes, from half that by the strains."""
    local = bilinear(combine, 2.0 * moment, -np.einsum("kab,...b->...ka", RIGHT, moved))
    spread = bilinear(combine, 2.0 * moment, turned)
    return np.asarray(local + np.einsum("eij,pleia->pleja", slopes, spread))


def gather(
    values: Float[np.ndarray, "*batch some width"], at: Int[np.ndarray, " some"], count: int
) -> Float[np.ndarray, "*batch count width"]:
    """Sum of the rows that belong to each of `count` places."""
    out = np.zeros((count, *values.shape[:-2], values.shape[-1]), values.dtype)
    np.add.at(out, at, np.moveaxis(values, -2, 0))
    return np.moveaxis(out, 0, -2)


def with_unit_rotations(z: Lanes, rows: int) -> Lanes:
    """Unknowns whose first `rows` are quaternions, these with length 1."""
    out = z.copy()
    q = out[:, :rows].reshape(len(z), -1, 4)
    size = np.linalg.norm(q, axis=-1, keepdims=True)
    out[:, :rows] = (q / np.maximum(size, LEAST)).reshape(len(z), rows)
    return out


def normalise(q: Jet) -> tuple[Jet, Jet, Jet]:
    """q/|q|, 1/|q| and |q|² of quaternions as jets."""
    square = bilinear(dot, q, q)
    rho = square[0]
    inverse = compose(rho**-0.5, -0.5 * rho**-1.5, 0.75 * rho**-2.5, square)
    return bilinear(lambda a, b: a[..., None] * b, inverse, q), inverse, square
