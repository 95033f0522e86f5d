"""All equilibria at given parameters: many starts, filtered and told apart."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float, Int

from equimorph.equilibria.curves import NewtonHomotopy
from equimorph.equilibria.newton import newton
from equimorph.equilibria.outcome import follow
from equimorph.equilibria.tracing import ARRIVAL, TraceOptions
from equimorph.model import Constraint, parameter_vector
from equimorph.structures import States, Structure

Lanes = Float[np.ndarray, "lanes size"]

SAME = 1e-6
"""Distance in the metric below which two equilibria over one point are the same."""


def find_equilibria(
    structure: Structure,
    at: Mapping[str, float],
    *,
    within: Sequence[Constraint] = (),
    starts: int = 400,
    seed: int = 0,
) -> States:
    """Equilibria at parameters `at`, sorted by energy.

    Newton from random guesses of the structure, then Newton homotopy from the guesses that failed,
    then the images under symmetries that leave `at` unchanged. States that the discretisation does
    not resolve, or that violate `within`, are dropped. An estimate of the whole, not a promise.

    Parameters
    ----------
    at
        All parameters without a default, by name.
    within
        Constraints that states must obey, like ``[arch.max_curvature <= 20]``.
    starts
        Number of random guesses.
    seed
        Of the random generator.

    Raises
    ------
    InputError
        For unknown parameters or values without meaning.
    """
    vector = parameter_vector(structure.parameters, at)
    p = np.tile(vector, (starts, 1))
    guesses = structure.sample(p, np.random.default_rng(seed))
    z, found = newton(structure, guesses, p)
    more = _by_homotopy(
        structure, guesses[~found][: starts // 4], p[: int((~found).sum())][: starts // 4]
    )
    pool = np.concatenate([z[found], more])
    pool = pool[_admissible(structure, pool, vector, within)]
    pool = _with_images(structure, pool[distinct(structure, pool)], vector)
    pool = pool[distinct(structure, pool)]
    states = States(structure, pool, np.tile(vector, (len(pool), 1)))
    return states[np.argsort(states.energy, kind="stable")]


def distinct(structure: Structure, z: Lanes) -> Int[np.ndarray, " distinct"]:
    """Return the first of each group of points closer than `SAME` in the metric."""
    kept: list[int] = []
    u = z[:, : structure.unknowns] * np.sqrt(structure.mass)
    for i in range(len(z)):
        if not kept or np.sqrt(((u[kept] - u[i]) ** 2).sum(axis=1)).min() > SAME:
            kept.append(i)
    return np.array(kept, dtype=int)


def _by_homotopy(
    structure: Structure, guesses: Lanes, p: Float[np.ndarray, "lanes parameters"]
) -> Float[np.ndarray, "found size"]:
    if len(guesses) == 0:
        return guesses
    p = p[: len(guesses)]
    curve = NewtonHomotopy(structure, p, structure.residual(guesses, p))
    options = TraceOptions(
        through_folds=True, through_branch_points=True, steps=300, record=False, locate_passed=False
    )
    outcome = follow(curve, guesses, (), options)
    arrived = outcome.code == ARRIVAL
    z, found = newton(structure, outcome.z[arrived], p[arrived], iterations=10)
    return np.asarray(z[found])


def _admissible(
    structure: Structure,
    z: Lanes,
    vector: Float[np.ndarray, " parameters"],
    within: Sequence[Constraint],
) -> np.ndarray:
    p = np.tile(vector, (len(z), 1))
    good = structure.resolved(z, p)
    for constraint in within:
        good = good & (constraint.excess(z, p) <= 0.0)
    return np.asarray(good)


def _with_images(
    structure: Structure, z: Lanes, vector: Float[np.ndarray, " parameters"]
) -> Float[np.ndarray, "more size"]:
    p = np.tile(vector, (len(z), 1))
    images = [
        symmetry.apply(z, p)[0]
        for symmetry in structure.symmetries()
        if np.array_equal(symmetry.signs * vector, vector)
    ]
    return np.concatenate([z, *images])
