"""All extrema of the curvature, against dense sampling."""

import numpy as np
import pytest

import equimorph as em


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
