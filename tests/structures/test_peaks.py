"""All extrema of the curvature, against dense sampling."""

import numpy as np
import pytest
from numpy.polynomial import legendre

import equimorph as em
from equimorph.structures.rod.extrema import largest_norms
from oracles.specimens import toggle


@pytest.mark.parametrize("load", ["uniform", "left-half"])
@pytest.mark.parametrize("setting", [(1.0, 0.2), (2.0, 1.0), (0.65, 0.52)])
def test_branches_of_the_largest_curvature_are_its_local_maxima(load, setting):
    """200 001 samples: maxima are parabolas, so that they lie 1e-8 below those, also at κ = 25."""
    arch = em.Rod(load)
    rest = arch.natural_state(Theta=setting[0], Delta=setting[1])
    state = em.lift(rest, {"q": 1.0}).end.state
    s = np.linspace(0.0, 1.0, 200001)
    kappa = np.abs(arch.fields(state.z[None], state.p[None], s)[0, :, 1])
    top = (kappa >= np.append(-1.0, kappa[:-1])) & (kappa >= np.append(kappa[1:], -1.0))
    values, places = arch.max_curvature.branches(state.z[None], state.p[None])
    np.testing.assert_allclose(values[0], kappa[top], rtol=0, atol=2e-8)
    np.testing.assert_allclose(places[0], s[top], rtol=0, atol=1e-5)
    np.testing.assert_allclose(values.max(), arch.max_curvature(state), rtol=2e-9)


def _highest(values, degree, to_legendre):
    """Largest norm of the interpolants at 1001 places of each element, by lanes."""
    basis = legendre.legvander(np.linspace(-1.0, 1.0, 1001), degree) @ to_legendre
    along = np.einsum("gi,leik->lgek", basis, values)
    return np.linalg.norm(along, axis=3).max(axis=1)


@pytest.mark.parametrize("degree", [4, 6, 10])
@pytest.mark.parametrize("components", [1, 2])
def test_the_highest_of_several_peaks_in_an_element_of_a_frame_is_taken(degree, components):
    """Random fields with many peaks of like heights, against sampling; 1e-3: of 1001 places."""
    frame = toggle(2, degree)
    values = np.random.default_rng(degree).normal(size=(60, 4, degree + 1, components))
    found = largest_norms(frame.model.mesh, values)
    sampled = _highest(values, degree, frame.model.mesh.reference.to_legendre)
    assert (found >= sampled * (1.0 - 1e-12)).all()
    np.testing.assert_allclose(found, sampled, rtol=1e-3)


def test_largest_norms_do_not_depend_on_other_lanes_nor_hide_what_is_no_number():
    mesh = toggle(2, 6).model.mesh
    values = np.random.default_rng(3).normal(size=(20, 4, 7, 2))
    values[3, 1, 2, 0], values[5] = np.nan, 0.0
    found = largest_norms(mesh, values)
    assert np.isnan(found[3, 1])
    assert np.isfinite(np.delete(found.ravel(), 3 * 4 + 1)).all()
    np.testing.assert_array_equal(found[5], 0.0)
    for k in range(len(values)):
        np.testing.assert_array_equal(largest_norms(mesh, values[[k]])[0], found[k])
    assert largest_norms(mesh, values[:0]).shape == (0, 4)


def test_the_highest_of_several_peaks_along_a_rod_in_space_is_taken():
    """Random rough states against sampling; 1e-3: of 1001 places in each element."""
    rod = em.SpatialRod(torsion=0.77, lateral=1.0, elements=2, degree=8)
    generator = np.random.default_rng(0)
    p = np.zeros((64, len(rod.parameters)))
    p[:, [each.name for each in rod.parameters].index("nu")] = 0.7
    z = rod.sample(p, generator)
    nodal = rod.recovery.nodal(z, p)
    bends = nodal.strains[..., 1:]
    sampled = _highest(bends, rod.mesh.degree, rod.mesh.reference.to_legendre).max(axis=1)
    assert (nodal.largest >= sampled * (1.0 - 1e-12)).all()
    np.testing.assert_allclose(nodal.largest, sampled, rtol=1e-3)
    order = generator.permutation(len(z))
    again = rod.recovery.nodal(z[order], p[order])
    np.testing.assert_array_equal(again.largest, nodal.largest[order])


def test_the_highest_of_several_peaks_along_a_general_rod_is_taken():
    """Random rough states with few elements against 4001 places along the rod."""
    rod = em.Rod(stiffness=lambda s: 1.0 + 0.3 * s, elements=2, degree=9)
    generator = np.random.default_rng(0)
    p = np.zeros((32, len(rod.parameters)))
    z = rod.sample(p, generator)
    found = rod.largest_curvature(z, p)[0]
    dense = np.abs(rod.fields(z, p, np.linspace(0.0, 1.0, 4001))[:, :, 1]).max(axis=1)
    assert (found >= dense * (1.0 - 1e-6)).all()
    np.testing.assert_allclose(found, dense, rtol=1e-3)
