"""Sets without end are refused: p = sin θ winds over p for ever."""

import pytest

import equimorph as em
from equimorph.manifold.lifting import flood
from typecheck import unchecked


def test_a_set_that_winds_for_ever_is_refused(monkeypatch):
    monkeypatch.setattr(flood, "ENDLESS", 12)
    load = em.Parameter("p", "1", 1.0, "load")
    winding = em.EnergyStructure("-cos(theta) - p*theta", ["theta"], [load])
    said = r"`within` must leave at most 12 equilibria over a point; got more over p = .* for ever"
    with unchecked(), pytest.raises(em.InputError, match=said):
        em.equilibrium_set(winding, em.Box(p=(-2, 2)), intervals=(3,))
