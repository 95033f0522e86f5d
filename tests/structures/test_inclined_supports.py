"""Rods with an end that rolls along an inclined line."""

import numpy as np
import pytest
from scipy.optimize import brentq

import equimorph as em
from equimorph.errors import InputError
from equimorph.structures import from_identity
from equimorph.study import parse_study, prepare
from typecheck import unchecked

FORCE = 4.0 * np.pi**2
"""Unit of force in B/L²."""


def turned(vector, angle):
    c, s = np.cos(angle), np.sin(angle)
    return c * vector[0] - s * vector[1], s * vector[0] + c * vector[1]


def loaded(rod, loads, **values):
    with unchecked():
        path = em.lift(rod.natural_state(**values), loads)
    assert path.end.kind == "arrived"
    return path.end.state


@pytest.mark.parametrize("sliding", ["A", "B"])
@pytest.mark.parametrize("slide", [0.5, -2.0])
def test_turning_the_axes_makes_it_a_roller_on_a_level_line(sliding, slide):
    """The same rod, seen by an observer turned by the slope. 1e-11: round-off of both solutions."""
    forces = {"q": (0.2, -1.0), "P": (0.0, -1.0)}

    def rod(roller, angle):
        ends = ("clamped", roller) if sliding == "B" else (roller, "clamped")
        loads = {
            "q": em.LineLoad(direction=turned(forces["q"], angle)),
            "P": em.PointForce(0.6, turned(forces["P"], angle)),
        }
        return em.Rod(ends=ends, loads=loads, EI=1.0, length=1.0, elements=4)

    held = f"theta_{'A' if sliding == 'B' else 'B'}"
    load, offset = {"q": 6.0, "P": 2.0}, 0.12
    inclined = loaded(
        rod(em.End("free", slide=slide), 0.0), load, **{held: slide + 0.3}, offset=offset
    )
    level = loaded(rod(em.End("free", x="free"), -slide), load, **{held: 0.3}, rise=offset)
    there = np.stack(turned(level.shape().T, slide), axis=1)
    np.testing.assert_allclose(inclined.shape(), there, atol=1e-11)
    np.testing.assert_allclose(inclined.energy, level.energy, rtol=1e-11)
    np.testing.assert_allclose(inclined.multipliers, level.multipliers, rtol=1e-9)
    assert inclined.index == level.index == 0
    np.testing.assert_allclose(inclined.margin, level.margin, rtol=1e-9)
    efforts = [
        each.structure.effort(each.batch.z, each.batch.p)[0, -1] for each in (inclined, level)
    ]
    np.testing.assert_allclose(efforts[0], efforts[1], rtol=1e-9)


@pytest.mark.parametrize("slide", [0.4, -0.7])
def test_a_bar_on_an_inclined_roller_carries_a_force_along_it(slide):
    """Two-force member: N (B·t)/|B| = P·t with |B| = 1 + N/EA and B = (1, 0) + σt. Round-off."""
    stiff, pull, c, s = 50.0, 3.0, np.cos(slide), np.sin(slide)
    bar = em.Rod(
        ends=("pinned", em.End("free", slide=slide)), axial=stiff, span=1.0, EI=1.0, length=1.0,
        loads={"P": em.PointForce(1.0, (1.0, 0.0))},
    )  # fmt: skip

    def missing(way):
        place = np.array([1.0 + way * c, way * s])
        length = np.hypot(*place)
        return stiff * (length - 1.0) * (place @ (c, s)) / length - pull * c

    way = brentq(missing, 0.0, 1.0, xtol=1e-15)
    tip = loaded(bar, {"P": pull}).shape()[-1]
    np.testing.assert_allclose(tip, [1.0 + way * c, way * s], atol=1e-10)


@pytest.mark.parametrize("slide", [0.0, 0.6, -0.6])
def test_a_propped_cantilever_on_an_inclined_roller(slide):
    """3qL/8 upright, so that the roller bears 3qL/(8 cos α); the axial force matters as q² does."""
    beam = em.Rod(
        ends=("clamped", em.End("free", slide=slide)), span=1.0, EI=1.0, length=1.0,
        loads={"q": em.LineLoad()},
    )  # fmt: skip
    load = 1e-3
    bent = loaded(beam, {"q": load})
    c = np.cos(slide)
    at_the_clamp = load * c - 3.0 * load / (8.0 * c)  # across the line: what the roller leaves
    np.testing.assert_allclose(FORCE * bent.multipliers[0], at_the_clamp, rtol=1e-3)


def test_a_rod_on_an_inclined_roller_is_written_and_built_again():
    rod = em.Rod(ends=("clamped", em.End("free", slide=0.3)), loads={"P": em.PointForce(0.5)})
    again = from_identity(rod.identity())
    assert again.signature == rod.signature
    offset = next(each for each in rod.parameters if each.name == "offset")
    assert offset.default == pytest.approx(-np.sin(1.0) * np.sin(0.3))


STUDY = """\
[structure]
kind = "rod"
ends = ["clamped", { angle = "free", slide = 0.3 }]
loads = { P = { term = "point force", s = 0.5 } }

[set]
box = { P = [0.0, 1.0] }
fixed = { theta_A = 0.1, offset = 0.0 }
within = ["max_curvature <= 10"]
"""


def test_a_study_may_have_one():
    problem = prepare(parse_study(STUDY, "roller.toml"))
    assert [each.name for each in problem.structure.parameters] == ["theta_A", "P", "offset"]


@pytest.mark.parametrize(
    ("ends", "message"),
    [
        ('["free", { slide = 0.3 }]', "must hold x and y of the end opposite to one that slides"),
        ("[{ slide = 0.1 }, { slide = 0.3 }]", "must hold x and y of the end opposite"),
        ("[{ x = 2.0 }, { slide = 0.3 }]", "must hold x and y of the end opposite"),
        ('["clamped", { x = "free", slide = 0.3 }]', "whose x and y are 'held'"),
        ('["clamped", { slide = 30.0 }]', "a direction in radians, within ±2π; got 30"),
        ('["clamped", { slide = "down" }]', "a direction in radians.*got 'down'"),
        ('["clamped", { slope = 0.3 }]', "be a word like"),
    ],
)
def test_inclined_rollers_that_mean_nothing(ends, message):
    text = STUDY.replace('["clamped", { angle = "free", slide = 0.3 }]', ends)
    with unchecked(), pytest.raises(InputError, match=message):
        prepare(parse_study(text, "roller.toml"))


def test_pressure_needs_ends_that_move_along_a_line_at_most():
    assert em.Rod(
        ends=("clamped", em.End("free", slide=0.3)), loads={"p": em.Pressure()}
    ).constraints
    with pytest.raises(InputError, match="a follower load without a potential"):
        em.Rod(ends=("clamped", em.End("free", "free", "free")), loads={"p": em.Pressure()})
