"""The softest mode of states, and the length over which it keeps its stiffness.

See docs/decisions.md, "Descents measure lengths by the soft mode".
"""

from dataclasses import dataclass

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Parameters, Values
from equimorph.columns import Columns
from equimorph.linalg import multiply
from equimorph.structures import Structure, stability_margin
from equimorph.structures.margin import generic_vectors, inverse_step
from equimorph.structures.metric import metric_length
from equimorph.tolerances import SAME_STATE

Modes = Float[np.ndarray, "lanes unknowns"]

INVERSE_ITERATIONS = 4
"""Inverse iterations for the mode of the smallest eigenvalue; the shift is close to it, so that
each reduces the error by several orders of magnitude."""
SHIFT = 1e-4
"""Distance of the shift below the eigenvalue, relative to it."""
SMALLEST = 1e-3
"""Eigenvalue below which the shift keeps its distance: at the eigenvalue it would be singular."""
NOTHING = 1e-6
"""Part of a response outside the mode, relative to the excitation, that counts as zero."""
GUESSES = 64
"""Random guesses whose extent is the scale of configurations."""
WIDEST = 0.1
"""Largest length of a mode, as a share of the extent of the guesses."""
DIFFERENCE, REFINEMENTS = 0.1, 4
"""Step of the difference of third derivatives, relative to the length as far as it is known; and
how often it becomes known better."""


@dataclass(frozen=True)
class SoftModes(Columns):
    """Smallest eigenvalue of the constrained Hessian in the metric, and its mode, per lane."""

    eigenvalue: Values
    """Energy over the metric's unit squared."""
    mode: Modes
    """Changes of the unknowns, of length one; a generic vector fixes the sign."""
    stiffness: Values
    """About the size of the other eigenvalues."""
    length: Values
    """Distance along the mode, in the metric, over which the eigenvalue changes by its own size:
    about the distance of a saddle from its neighbours. At critical states the distance over which
    the third derivative changes so."""
    own_length: Values
    """The former at critical states, too: about the distance to their neighbours."""
    rate: Values
    """Size of the eigenvalue at this distance: its inverse is the scale of time."""
    critical: Flags
    """Whether the state is a fold or branch point: it is not unstable, or the next state would be
    the same state."""


def soft_modes(structure: Structure, z: Lanes, p: Parameters) -> SoftModes:
    """Softest modes of states, by inverse iteration just below the smallest eigenvalue.

    The length is the smaller one of ``|λ| / |D³E[v, v, v]|`` and ``√(2 |λ| / |D⁴E[v, v, v, v]|)``,
    at most `WIDEST` of the extent of the guesses.
    """
    n, mass = structure.unknowns, structure.mass
    eigenvalue = stability_margin(structure, z, p)
    shift = eigenvalue - SHIFT * np.maximum(np.abs(eigenvalue), SMALLEST)
    generic = generic_vectors(structure, len(z))
    mode = generic
    for _ in range(INVERSE_ITERATIONS):
        mode = inverse_step(structure, z, p, mode, shift)[:, :n]
        mode = mode / metric_length(structure, mode)[:, None]
    mode = mode * np.copysign(1.0, multiply(generic * mode, mass))[:, None]
    rest = generic - multiply(generic * mode, mass)[:, None] * mode
    response = inverse_step(structure, z, p, rest, shift)[:, :n]
    response -= multiply(response * mode, mass)[:, None] * mode
    size, answer = metric_length(structure, rest), metric_length(structure, response)
    # without another way to move there is no response outside the mode
    stiffness = np.where(answer > NOTHING * size, size / np.maximum(answer, 1e-300), 0.0)
    # the shift is far larger than small eigenvalues, which would have no digit left
    across = multiply(mode * inverse_step(structure, z, p, mode, np.zeros(len(z)))[:, :n], mass)
    with np.errstate(divide="ignore"):
        eigenvalue = np.where(np.isfinite(across) & (across != 0.0), 1.0 / across, eigenvalue)
    lengths, rate, critical = _lengths(structure, z, p, mode, eigenvalue)
    stiffness = np.where(stiffness > 0.0, np.maximum(stiffness, np.abs(eigenvalue)), rate)
    return SoftModes(eigenvalue, mode, stiffness, *lengths, rate, critical)


def extent_of_guesses(structure: Structure, p: Parameters) -> float:
    """Diameter of the ball around random guesses in the metric: the scale of configurations."""
    many = np.repeat(p[:1], GUESSES, axis=0)
    u = structure.sample(many, np.random.default_rng(0))[:, : structure.unknowns]
    return 2.0 * float(metric_length(structure, u - u.mean(axis=0)).max())


def extents_of_guesses(structure: Structure, p: Parameters) -> Values:
    """The same for each lane at its own parameters."""
    own, back = np.unique(p, axis=0, return_inverse=True)
    return np.array([extent_of_guesses(structure, each[None]) for each in own])[back.ravel()]


def _lengths(
    structure: Structure, z: Lanes, p: Parameters, mode: Modes, eigenvalue: Values
) -> tuple[tuple[Values, Values], Values, Flags]:
    """Both lengths of modes, the size of eigenvalues there, and where the state is critical."""
    widest = WIDEST * extents_of_guesses(structure, p)
    size = np.abs(eigenvalue)
    third = np.abs(_third(structure, z, p, mode))
    by_third = size / np.maximum(third, 1e-300)
    length = np.minimum(by_third, widest)
    for _ in range(REFINEMENTS):
        step = DIFFERENCE * np.maximum(length, SAME_STATE)
        move = np.zeros_like(z)
        move[:, : structure.unknowns] = step[:, None] * mode
        change = _third(structure, z + move, p, mode) - _third(structure, z - move, p, mode)
        fourth = np.maximum(np.abs(change) / (2.0 * step), 1e-300)
        length = np.minimum(np.minimum(by_third, np.sqrt(2.0 * size / fourth)), widest)
    critical = (length <= SAME_STATE) | (eigenvalue >= 0.0)
    at_fold = np.minimum(third / fourth, widest)
    beyond = np.where(at_fold > SAME_STATE, at_fold, widest)  # by symmetry there is no third one
    rate = np.where(critical, (third + 0.5 * fourth * beyond) * beyond, size)
    # without any stiffness time is counted in units of one
    lengths = np.where(critical, beyond, length), length
    return lengths, np.where(rate > 0.0, rate, 1.0), critical


def _third(structure: Structure, z: Lanes, p: Parameters, mode: Modes) -> Values:
    """D³E[v, v, v]."""
    n, still = structure.unknowns, np.zeros_like(p)
    along = np.zeros_like(z)
    along[:, :n] = mode
    bent = structure.second_derivative(z, p, (along, still), (along, still))[:, :n]
    return np.asarray((bent * mode).sum(axis=1))
