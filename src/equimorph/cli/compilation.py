"""Compiling kernels before the first run: two processes, each with its share of them.

What marches along curves and joins surfaces knows no structure, so that one process compiles it on
a small spring while the other compiles what belongs to the structure of the study.
"""

import subprocess
import sys

import numpy as np

from equimorph.equilibria import find_equilibria, limit_load
from equimorph.equilibria.step_kernels import proceed
from equimorph.linalg.compiled import is_kept
from equimorph.manifold import equilibrium_set
from equimorph.model import Box, Constraint
from equimorph.structures import Spring
from equimorph.study import Problem

_MARCH = f"from {__name__} import march; march()"


def kernels_are_in_cache() -> bool:
    """Whether an earlier run left the kernels that every study needs."""
    return is_kept(proceed)


def compile_kernels(problem: Problem) -> None:
    """Compile what a study needs, so that the run itself finds it on disk.

    Parameters
    ----------
    problem
        The study; its set is not computed.
    """
    with subprocess.Popen(
        [sys.executable, "-c", _MARCH], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
    ):
        evaluate(problem)


def march() -> None:
    """Find, follow and join the equilibria of a small spring."""
    spring = Spring()
    box = Box(x_l=(0.4, 1.4), F=(-0.3, 0.3))
    equilibrium_set(spring, box, intervals=(4, 4))
    find_equilibria(spring, {"x_l": 0.8, "F": 0.0})
    limit_load(spring.natural_state(x_l=0.8), "F")


def evaluate(problem: Problem) -> None:
    """Evaluate everything that the structure of a study knows of one state."""
    structure, values = problem.structure, dict[str, float]()
    constraints: tuple[Constraint, ...] = ()
    for each in structure.parameters:
        values[each.name] = 0.3 * each.scale if each.default is None else each.default
    for extent in [*problem.extents.values()][:1]:
        box, constraints = extent.box, extent.constraints
        values |= dict(zip(box.names, (box.lower + box.upper) / 2, strict=True))
        values |= dict(extent.fixed)
    values |= dict(structure.unloaded())
    p = np.array([[values[each.name] for each in structure.parameters]])
    structure.natural(p)
    z = structure.sample(p, np.random.default_rng(0))  # natural states need not exist here
    zero, one = np.zeros(1), np.ones_like(p)
    structure.advance(z, p, one, z, zero, zero)
    structure.second_derivative(z, p, (z, one), (z, one))
    structure.effort(z, p)
    structure.index(z, p)
    structure.resolved(z, p)
    structure.error_estimate(z, p)
    structure.shape(z, p)
    for shown in (problem.ground.height, *(limit.descriptor for limit in constraints)):
        shown.function(z, p)
