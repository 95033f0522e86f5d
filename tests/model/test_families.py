"""Scalars of one family are computed together: the same numbers as each by itself."""

from functools import partial

import numpy as np
import pytest

import equimorph as em
from equimorph.model.families import values_together

SOME = np.linspace(0.1, 0.9, 5)


@pytest.mark.parametrize("kind", ["clamped", "general", "space"])
def test_fields_at_several_places_are_those_at_each(kind):
    """To round-off of sums over nodes: libraries choose their order by the number of places."""
    rod = {
        "clamped": em.Rod,
        "general": partial(em.Rod, ends=("clamped", "free")),
        "space": partial(em.SpatialRod, torsion=0.77, lateral=1.0),
    }[kind]()
    state = rod.natural_state(**({} if kind == "general" else {"Theta": 1.0}))
    z = state.z + 0.1 * np.random.default_rng(0).normal(size=(7, len(state.z)))
    p = np.repeat(state.p[None], len(z), axis=0)
    heights = [rod.height(s).function for s in SOME]
    others = [*heights[:2], rod.descriptor("energy").function, rod.position(0.5)[0].function]
    for functions in (heights, heights[:1], others):
        each = np.stack([function(z, p) for function in functions], axis=1)
        np.testing.assert_allclose(values_together(functions, z, p), each, rtol=1e-13, atol=1e-15)


def test_heights_are_one_call(monkeypatch):
    rod, calls = em.Rod(), []
    places = rod.places
    monkeypatch.setattr(rod, "places", lambda *given: calls.append(given) or places(*given))
    state = rod.natural_state(Theta=1.0)
    found = values_together([rod.height(s).function for s in SOME], state.z[None], state.p[None])
    assert len(calls) == 1
    assert found.shape == (1, len(SOME))


def test_nothing_to_compute():
    assert values_together([], np.zeros((3, 2)), np.zeros((3, 1))).shape == (3, 0)
