"""Forces of supports by their axes."""

import pytest

import equimorph as em


@pytest.mark.parametrize(("axis", "symbol"), [("x", "lambda"), ("y", "mu")])
def test_forces_have_the_names_of_their_axes(axis: str, symbol: str):
    """PHYSICS section 3: (λ, μ) is the force of the support at A on the rod, along x and y."""
    rod = em.Rod(load="uniform")
    state = em.lift(rod.natural_state(Theta=0.9), {"q": 1.0}).end.state
    force = rod.descriptor(f"support_force({axis})")(state)
    assert force == rod.support_force(symbol)(state)
    assert force != 0.0
    assert rod.support_force(axis).name == f"support_force({axis})"


def test_half_of_a_symmetric_load_is_carried_at_each_end():
    """μ = q/2, PHYSICS section 5, first row."""
    rod = em.Rod(load="uniform")
    state = em.lift(rod.natural_state(Theta=0.9), {"q": 1.0}).end.state
    assert rod.support_force("y")(state) == pytest.approx(0.5, rel=1e-9)
