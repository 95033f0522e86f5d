"""Elements for a bound of the curvature; what finer elements do not resolve either."""

import numpy as np
import pytest
from scipy.optimize import brentq
from scipy.special import j0

from equimorph import Box, Rod, SpatialRod, equilibrium_set
from equimorph.errors import InputError
from equimorph.structures.resolution import TAIL, turn_of_element
from equimorph.structures.rod.discretisation import reference_element
from equimorph.structures.spatial.lagrangian import LARGEST_TAIL
from oracles.specimens import toggle


@pytest.mark.parametrize("wave", [0.4, 0.5, 0.8])
@pytest.mark.parametrize("degree", [4, 6, 8, 9, 12])
def test_waves_as_curved_as_the_bound_are_resolved_by_an_element_and_not_by_a_longer_one(
    degree, wave
):
    """A sin(ks + φ) with κ = Ak at the nodes; the bound is the first term of a Bessel function."""
    element, phase = reference_element(degree), np.linspace(0.0, np.pi, 33)[:, None]

    def tail(turn):
        angle = wave * np.sin(turn / wave * (element.nodes - 0.5) + phase)
        return np.abs(angle @ element.to_legendre[-2:].T).max()

    turn = turn_of_element(degree, wave)
    assert tail(turn) <= TAIL
    assert tail(1.25 * turn) > TAIL


def test_structures_keep_all_but_their_elements():
    """Functions, defaults and degrees stay; a bound that the elements resolve changes nothing."""
    rod = Rod(lambda s: 1.0 + s, span=0.7, degree=8)
    fine = rod.resolving(24.0)
    assert fine.resolution == (14, 8)
    assert [each.default for each in fine.parameters] == [each.default for each in rod.parameters]
    assert rod.resolving(1.0).resolution == rod.resolution == (6, 8)
    assert SpatialRod(torsion=0.77, lateral=1.4).resolving(20.0).resolution == (18, 6)


@pytest.mark.parametrize(("reach", "wave"), [(None, 0.55), (0.92, 0.4027), (0.98, 0.2003)])
def test_helices_are_resolved_in_space(reach, wave):
    """R = Rx(φ) Rz(A) Rx(−φ) has tangents at A from the axis x, and κ = φ' sin A.

    The span is cos A; without a reach, 85 % of the length.
    """
    bound = 20.0
    rod = SpatialRod(torsion=0.77, lateral=1.4).resolving(bound, reach)
    mesh = rod.mechanics.mesh
    for start in np.linspace(0.0, np.pi, 9):
        phase = start + bound / np.sin(wave) * mesh.nodes
        aside = np.sin(0.5 * wave) * np.stack([np.sin(phase), np.cos(phase)])
        q = np.stack([np.full_like(phase, np.cos(0.5 * wave)), 0.0 * phase, *aside], axis=1)
        assert np.abs(np.einsum("cn,na->ca", mesh.highest, q)).max() < LARGEST_TAIL


@pytest.mark.parametrize("reach", [0.95, 0.98, 0.99])
def test_waves_of_a_rod_are_resolved_whose_ends_are_almost_its_length_apart(reach):
    """θ = A sin(ks) has the span J₀(A), and κ = Ak; rods with less reach do not resolve it."""
    wave, bound = brentq(lambda each: j0(each) - reach, 0.0, 1.0), 20.0
    rod = Rod()
    fine, coarse = (rod.resolving(bound, each).mechanics for each in (reach, 0.6 * reach))
    phase = np.linspace(0.0, np.pi, 33)[:, None]

    def tail(mechanics):
        angle = wave * np.sin(bound / wave * mechanics.mesh.nodes + phase)
        return np.abs(angle @ mechanics.mesh.highest.T).max()

    assert tail(fine) < TAIL
    if reach > 0.97:
        assert tail(coarse) > TAIL


def test_a_reach_is_a_length_below_that_of_the_rod():
    """In the unit of length; waves of a straight rod are as flat as one likes."""
    rod = Rod(EI=1.0, length=0.5)
    assert rod.resolving(40.0, 0.49).resolution == Rod().resolving(20.0, 0.98).resolution
    with pytest.raises(
        InputError, match=r"`reach` must be at most 0\.999 of the length, 0\.5; got"
    ):
        rod.resolving(40.0, 0.5)


def test_lengths_count_in_the_units_of_the_bound():
    """A rod of half a metre turns by as much under twice the bound."""
    rod = Rod(EI=1.0, length=0.5)
    assert rod.resolving(40.0).resolution == Rod().resolving(20.0).resolution


@pytest.mark.slow
def test_a_set_lacks_no_states_with_elements_for_its_bound():
    """Two stiff members between clamps: their waves are short long before they are curved."""
    coarse, bound = toggle(elements=2, degree=8), 8.0
    left_out = []
    for frame in (coarse, coarse.resolving(bound)):
        eset = equilibrium_set(
            frame,
            Box(a=(-0.5, -0.4)),
            fixed={"P": 0.0},
            within=[frame.max_curvature <= bound],
            intervals=(4,),
        )
        left_out.append(eset.audit.left_out)
    assert left_out[0] > 0
    assert left_out[1] == 0
