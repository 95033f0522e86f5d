"""Cusps of the arch on Δ = 0 at q = 2.5: pitchforks of the symmetric slice, judged by shooting.

Over (Θ, Δ) the set is smooth at Δ = 0; a pitchfork along Θ there is a cusp of its folds.
"""

import numpy as np
import pytest

from equimorph.manifold import EquilibriumSet, equilibrium_set
from equimorph.model import Box
from equimorph.structures import Rod
from oracles.shots import SPAN, UNIFORM, all_equilibria, from_states
from typecheck import unchecked

CAP = 20.0
PITCHFORKS = {1.2103306921: 1, 0.9836038679: 3, 0.9013414855: 4}
"""Θ, and the negative eigenvalues besides the one that vanishes."""
FOLD = 1.3283235091
"""Θ at which stable and unstable symmetric states meet, with max |κ| = 8.58."""


@pytest.fixture(scope="module")
def diagram() -> EquilibriumSet:
    """All states over Θ at Δ = 0."""
    arch = Rod()
    with unchecked():
        return equilibrium_set(
            arch,
            Box(Theta=(0.2, 2.5)),
            fixed={"q": 2.5, "Delta": 0.0},
            within=[arch.max_curvature <= CAP],
            intervals=(60,),
        )


def test_three_pitchforks_and_none_of_stable_states(diagram):
    """So the boundary of stability over (Θ, Δ) has no cusp on Δ = 0; it crosses it in a fold."""
    crossed = diagram.kinds == 7
    theta, index = diagram.points["Theta"][crossed], diagram.index[crossed]
    order = np.argsort(-theta)
    np.testing.assert_allclose(theta[order], list(PITCHFORKS), rtol=0, atol=1e-9)
    assert index[order].tolist() == list(PITCHFORKS.values())
    stable = (diagram.kinds == 1) & (diagram.index == 0)
    np.testing.assert_allclose(diagram.points["Theta"][stable], [FOLD], rtol=0, atol=1e-9)


@pytest.mark.parametrize(
    "theta", [0.7, 0.898, 0.9055, 0.981, 0.987, 1.205, 1.2153, 1.32, 1.335, 1.9]
)
def test_shooting_finds_the_same_states_with_the_same_index(diagram, theta):
    """On both sides of each pitchfork and of the fold; index: conjugate points of the shot."""
    here = diagram.at(Theta=theta)
    known, solved = from_states(here, UNIFORM).solved()
    assert solved.all()
    assert known.forces == pytest.approx(here.multipliers, abs=1e-3)
    assert np.array_equal(known.index(), here.index)
    random = all_equilibria(UNIFORM, (theta, 0.0, 2.5, SPAN), 600, 1)
    random = random.take(random.max_curvature() <= CAP)
    assert len(random) >= 1
    gap = np.abs(random.forces[:, None] - known.forces[None]).max(axis=2)
    assert gap.min(axis=1).max() < 1e-6


@pytest.mark.parametrize(("theta", "low"), PITCHFORKS.items())
def test_the_symmetric_state_changes_its_index_and_two_mirror_images_appear(diagram, theta, low):
    (mirror,) = diagram.structure.symmetries()
    n, mass = diagram.structure.unknowns, diagram.structure.mass
    seen, images = [], []
    for side in (-1e-5, 1e-5):
        here = diagram.at(Theta=theta + side)
        image, _ = mirror.apply(here.z, here.p)
        off = np.sqrt((image - here.z)[:, :n] ** 2 @ mass)
        seen.append(sorted(here.index[off < 1e-6].tolist()))
        images.append(int((off >= 1e-6).sum()))
    a, b = (np.bincount(each, minlength=9) for each in seen)
    assert np.abs(a - b)[[low, low + 1]].tolist() == [1, 1]
    assert abs(images[0] - images[1]) == 2
