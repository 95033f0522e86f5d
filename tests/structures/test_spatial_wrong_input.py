"""Sections, clamps and places that make no rod in space are refused or told, each in one line."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError

ROUND = {"torsion": 0.77, "lateral": 1.0}
MADE = {"E": "70 GPa", "nu": 0.3}


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (lambda: em.Strip("20 mm", "1 mm", E="70 GPa", nu=0.6), "`nu` must be Poisson's ratio"),
        (lambda: em.Round("2 mm", E="70 GPa", nu=-1.0), "`nu` must be Poisson's ratio"),
        (lambda: em.Strip("-20 mm", "1 mm", **MADE), "`width` must be positive and finite"),
        (lambda: em.Round("2 mm", E="0 GPa", nu=0.3), "`E` must be positive and finite"),
        (lambda: em.OwnSection(EI=1.0, EI_out=-1.0, GJ=1.0), "`EI_out` must be positive"),
        (
            lambda: em.SpatialRod(section=em.Tube("2 mm", "1.5 mm", **MADE), length="1 m"),
            "`wall`",
        ),
        (
            lambda: em.SpatialRod(section={"kind": "round", "diameter": "2 mm", "E": "1 GPa",
                                           "nu": 0.7}, length="1 m"),
            "`nu` must be Poisson's ratio",
        ),
    ],
)  # fmt: skip
def test_impossible_sections(make, text):
    with pytest.raises(InputError, match=text):
        make()


@pytest.mark.parametrize(
    ("options", "text"),
    [
        ({"torsion": np.nan}, "`torsion` must be a finite number"),
        ({"lateral": np.inf}, "`lateral` must be a finite number"),
        ({"lateral": None}, "`lateral` must be given together with `torsion`"),
        ({"axial": 1.0, "shear": -2.0}, "`shear` must be positive everywhere"),
        ({"ends": ("clamped", {"rotation": "sprung"})}, "A spring against rotations"),
        ({"phase": 1}, "`phase` must be True or False; got 1"),
    ],
)
def test_impossible_rods(options, text):
    with pytest.raises(InputError, match=text):
        em.SpatialRod(**{**ROUND, **options})


@pytest.mark.parametrize(
    ("values", "text"),
    [
        ({"Theta": 0.5, "twist_A": 20.0}, "`twist_A` must be a finite number between"),
        ({"Theta": 0.5, "nu": 1.0}, "`nu` must be a finite number between"),
        ({"Theta": 0.0}, "the continuation ends before. A straight rod buckles either way"),
        ({"Theta": 0.5, "nu": 0.9, "rise": 0.9}, "the continuation ends before"),
    ],
)
def test_clamps_between_which_there_is_no_natural_state(values, text):
    with pytest.raises(InputError, match=text):
        em.SpatialRod(**ROUND).natural_state(**values)


def test_a_clamp_tilted_by_a_quarter_turn_is_told():
    """R = exp(e₃ a) exp(e₂ π/2) exp(e₁ τ) depends on a − τ alone."""
    rod = em.SpatialRod(**ROUND)
    warned = rod.warnings(rod.natural_state(Theta=0.5, tilt_A=0.5 * np.pi))
    assert any("tilt_A = 1.5708 is at a quarter turn" in each for each in warned)
    assert not rod.warnings(rod.natural_state(Theta=0.5, tilt_A=0.5))
