"""Quantities with units: factors by definition [BIPM2019]_; structures in any units agree."""

import numpy as np
import pytest
from hypothesis import given, strategies as st

import equimorph as em
from equimorph.errors import InputError
from equimorph.structures import from_identity
from equimorph.structures.unit_system import UNITS, UnitSystem, read_unit, unit_system
from equimorph.study.prepare import build_structure
from equimorph.study.problem import parse_study

METRIC = {"force": "N", "length": "m"}
SHORT = {"force": "kN", "length": "mm"}


@pytest.mark.parametrize(
    ("text", "quantity", "number"),
    [
        ("2 kN", "force", 2e3),
        ("-3.5e2 mm", "length", -0.35),
        ("0.2 kN m^2", "force·length²", 200.0),
        ("0.2 kN·m²", "force·length²", 200.0),
        ("210 GPa mm^4", "force·length²", 0.21),
        ("1 N/mm", "force/length", 1e3),
        ("4 1/mm", "1/length", 4e3),
        ("2 m^-1", "1/length", 2.0),
        ("1 kg/m", "force/length", 9.80665),
        ("1 lbf", "force", 4.4482216152605),
        ("12 in", "length", 0.3048),
        ("1 psi in^2", "force", 4.4482216152605),
    ],
)
def test_texts_are_numbers_in_si(text, quantity, number):
    """Factors by definition; round-off."""
    assert UnitSystem("N", "m").number(text, quantity, "x") == pytest.approx(number, rel=1e-14)


@given(
    st.floats(1e-6, 1e6),
    st.sampled_from([name for name, (_, of) in UNITS.items() if of == (0, 1, 0)]),
    st.sampled_from([name for name, (_, of) in UNITS.items() if of == (1, 1, -2)]),
)
def test_a_number_in_the_system_s_own_units_is_itself(value, length, force):
    system = UnitSystem(force, length)
    for quantity in ("force", "length", "force·length²", "force/length", "1/length"):
        text = f"{value!r} {system.label(quantity)}"
        assert system.number(text, quantity, "x") == pytest.approx(value, rel=1e-13)


def test_labels_are_those_of_the_system():
    assert UnitSystem("kN", "mm").label("force·length²") == "kN mm²"
    assert UnitSystem().label("force·length²") == "force·length²"


# --- structures ----------------------------------------------------------------------------------


def two_bars(units, texts=False):
    """A shallow two-bar truss of steel rods, 2 m wide."""
    system = unit_system(units)
    given = {
        "EA": "2.1 MN", "EI": "1.5 kN m^2", "half": "1 m", "rise": "0.1 m", "rest": "1.006 m",
    }  # fmt: skip
    kinds = {"EA": "force", "EI": "force·length²"}
    if not texts:
        given = {k: system.number(v, kinds.get(k, "length"), k) for k, v in given.items()}
    minus = "-1 m" if texts else -given["half"]
    joints = {"A": (minus, 0), "B": (0, given["rise"]), "C": (given["half"], 0)}
    bars = [
        em.Bar(("A", "B"), EA=given["EA"], EI=given["EI"], rest=given["rest"]),
        em.Bar(("B", "C"), EA=given["EA"], EI=given["EI"]),
    ]
    held = {"A": "xy", "C": "xy"}
    loads, actuators = {"F": {"B": (0, -1)}}, {"a": {"A-B": 1.0}}
    return em.Truss(joints, bars, held, loads, actuators, units=units)


@pytest.mark.parametrize("texts", [False, True])
def test_a_truss_is_the_same_in_all_units(texts):
    """Limit load, moves, forces, utilisation, energy; 1e-9: states are corrected to 1e-10."""
    si, short = two_bars(METRIC, texts), two_bars(SHORT, texts)
    here = em.limit_load(si.natural_state(a=0.002), "F").state
    there = em.limit_load(short.natural_state(a=2.0), "F").state
    for text, factor, unit in (
        ("displacement(B,y)", 1e3, "mm"),
        ("force(A-B)", 1e-3, "kN"),
        ("utilisation(A-B)", 1.0, "1"),
        ("travel(F)", 1e3, "mm"),
        ("effort(a)", 1e-3, "kN"),
        ("energy", 1.0, "kN mm"),
    ):
        value = si.descriptor(text)(here) * factor
        assert short.descriptor(text)(there) == pytest.approx(value, rel=1e-6, abs=1e-12)
        assert short.descriptor(text).unit == unit
    assert there["F"] == pytest.approx(1e-3 * here["F"], rel=1e-9)
    assert [each.unit for each in short.parameters] == ["mm", "kN"]
    assert short.length_unit == "mm"


def test_a_truss_with_units_is_that_of_plain_numbers():
    """The same numbers without names of units, bit for bit."""
    named = two_bars(METRIC)
    data = named.identity()
    assert data.pop("units") == METRIC
    plain = from_identity(data)
    p = np.array([[0.01, 3e4]])
    z = named.sample(p, np.random.default_rng(1))
    np.testing.assert_array_equal(plain.residual(z, p), named.residual(z, p))
    assert from_identity(named.identity()).identity() == named.identity()


def portal(units, size, stiff, spring, weight):
    """A sprung portal with an actuated column."""
    return em.Frame(
        {"A": (0, 0), "B": (0, size), "C": (size, size)},
        [em.Member(("A", "B"), stiff, weight=weight), em.Member(("B", "C"), stiff)],
        {"A": "fixed", "C": {"x": spring, "y": "held"}},
        {"P": {"B": (1, -1)}, "g": {"weight": (0, -1)}},
        {"k": {"curvature": {"A-B": 1}}},
        units=units,
    )


def test_a_frame_is_the_same_in_all_units():
    """m and N, mm and kN, and texts; a weight may be a mass per length. 1e-9: as above."""
    g = 9.80665
    frames = (
        portal(METRIC, 0.5, 2.0, 300.0, 0.8 * g),
        portal(SHORT, 500.0, 2.0e3, 300.0e-6, 0.8 * g * 1e-6),
        portal(SHORT, "0.5 m", "2 N m^2", "0.3 N/mm", "0.8 kg/m"),
    )
    loads = ({"P": 4.0, "g": 1.0, "k": 0.4},) + 2 * ({"P": 4e-3, "g": 1.0, "k": 0.4e-3},)
    si, short, texts = (
        em.lift(frame.natural_state(), values).end.state
        for frame, values in zip(frames, loads, strict=True)
    )
    for text, factor, unit in (
        ("displacement(B,x)", 1e3, "mm"),
        ("moment(A-B,A)", 1.0, "kN mm"),
        ("reaction(C,x)", 1e-3, "kN"),
        ("max_curvature", 1e-3, "1/mm"),
        ("effort(k)", 1e3, "kN mm²"),
        ("travel(P)", 1e3, "mm"),
        ("energy", 1.0, "kN mm"),
    ):
        value = frames[0].descriptor(text)(si) * factor
        for frame, state in ((frames[1], short), (frames[2], texts)):
            assert frame.descriptor(text)(state) == pytest.approx(value, rel=1e-8), text
            assert frame.descriptor(text).unit == unit
    assert short.energy == pytest.approx(si.energy, rel=1e-9)
    assert [each.unit for each in frames[1].parameters] == ["1/mm", "kN", "1"]
    again = from_identity(frames[2].identity())
    assert again.identity() == frames[2].identity()
    assert again.parameters == frames[2].parameters


def test_a_rod_is_the_same_in_all_units():
    """A cantilever by numbers in SI, by texts in SI, and in mN and mm. 1e-9: as above."""
    soft = {"ends": ("clamped", "free"), "loads": {"P": em.PointForce(1.0)}}
    rods = (
        em.Rod(EI=2e-4, length=0.1, axial=40.0, curvature=3.0, **soft),
        em.Rod(EI="0.2 mN m^2", length="10 cm", axial="40 N", curvature="3 1/m", **soft),
        em.Rod(
            EI="0.2 mN m^2", length="10 cm", axial="40 N", curvature="0.003 1/mm", **soft,
            units={"force": "mN", "length": "mm"},
        ),
    )  # fmt: skip
    assert (rods[2].units.bending_stiffness, rods[2].units.length) == pytest.approx((2e5, 100.0))
    si, texts, short = (
        em.lift(rod.natural_state(), {"P": load}).end.state
        for rod, load in zip(rods, (0.03, 0.03, 30.0), strict=True)
    )
    np.testing.assert_allclose(texts.z, si.z, atol=1e-12)
    for text, factor, unit in (
        ("height(1)", 1e3, "mm"),
        ("max_curvature", 1e-3, "1/mm"),
        ("end_moment(0)", 1e6, "mN mm"),
        ("energy", 1e6, "mN mm"),
    ):
        value = rods[0].descriptor(text)(si) * factor
        assert rods[2].descriptor(text)(short) == pytest.approx(value, rel=1e-9)
        assert rods[2].descriptor(text).unit == unit
    assert rods[2].descriptor("energy").unit == "mN mm"
    assert from_identity(rods[2].identity()).identity() == rods[2].identity()


def test_a_study_may_name_units():
    text = """
    [structure]
    kind = "truss"
    units = { force = "kN", length = "mm" }
    joints = { A = ["-1 m", 0], B = [0.0, 100.0], C = ["1 m", 0] }
    bars = [{ ends = ["A", "B"], EA = "2.1 MN" }, { ends = ["B", "C"], EA = 2100.0 }]
    supports = { A = "xy", C = "xy" }
    loads = { F = { B = [0, -1] } }
    actuators = { a = { A-B = 1.0 } }
    [set]
    box = { a = [-1.0, 1.0], F = [0.0, 1.0] }
    """
    made = build_structure(parse_study(text, "units.toml").structure)
    assert made.network.members[0].EA == made.network.members[1].EA == 2100.0
    assert made.network.places[0, 0] == -1000.0


# --- wrong input ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("make", "text"),
    [
        (
            lambda: portal(METRIC, 1.0, "2 N m", 1.0, 1.0),
            "`EI of member A-B` must be in units of force·length², like N m²; got '2 N m'",
        ),
        (
            lambda: portal(METRIC, 1.0, "2 kg m^2", 1.0, 1.0),
            "must be in units of force·length², like N m²; got '2 kg m^2'",
        ),
        (
            lambda: portal(METRIC, 1.0, "2 Nm", 1.0, 1.0),
            "must be in units such as kN or N mm^2, of m, mm",
        ),
        (lambda: portal(METRIC, 1.0, "2 N m2 + 1", 1.0, 1.0), "must be in units such as kN"),
        (lambda: portal(METRIC, 1.0, "stiff", 1.0, 1.0), "`EI` must be positive and finite"),
        (lambda: portal(METRIC, 1.0, "-2 N m^2", 1.0, 1.0), "`EI` must be positive and finite"),
        (lambda: portal(METRIC, 1.0, "2", 1.0, 1.0), "with its unit, like '2.5 mm'; got '2'"),
        (
            lambda: portal(None, 1.0, "2 N m^2", 1.0, 1.0),
            "`units` must be given where a quantity has a unit; got EI of member A-B = '2 N m^2'",
        ),
        (lambda: portal(METRIC, 1.0, 1.0, "2 N", 1.0), "`supports.C.x` must be in units of"),
        (lambda: portal({"force": "N"}, 1.0, 1.0, 1.0, 1.0), "`units` must be a table like"),
        (
            lambda: portal({"force": "mm", "length": "m"}, 1.0, 1.0, 1.0, 1.0),
            "`units.force` must be one of N, mN, uN, kN, MN, lbf, kip, kgf; got 'mm'",
        ),
        (lambda: portal({"force": "N", "length": None}, 1.0, 1.0, 1.0, 1.0), "got length = None"),
        (lambda: em.Rod(EI="0.2 N m", length=0.1), "`EI` must be in units of force·length²"),
        (lambda: em.Rod(span="0.2 m"), "`units` must be given where a quantity has a unit"),
        (lambda: em.Rod(units=METRIC), "`units` must come with EI and length; got"),
        (lambda: em.Rod(EI="0.2 N m^2"), "`length` must be given together with `EI`"),
    ],
)  # fmt: skip
def test_inconsistent_units_are_refused(make, text):
    with pytest.raises(InputError) as caught:
        make()
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)


def test_close_names_of_units_are_suggested():
    with pytest.raises(InputError, match="Did you mean kN"):
        read_unit("KN", UNITS, "EA")


def test_a_length_without_a_unit_beside_one_with_units_is_refused():
    said = r"^`length` must have a unit, as EI = '2 N m\^2' has one; got 0\.1\."
    with pytest.raises(em.InputError, match=said):
        em.Rod(load="uniform", EI="2 N m^2", length=0.1)
    with pytest.raises(em.InputError, match=r"^`span` must have a unit, as EI = .* has one; got 0"):
        em.Rod(load="uniform", EI="2 N m^2", length="100 mm", span=0.05)
    units = {"force": "N", "length": "m"}
    named = em.Rod(load="uniform", EI="2 N m^2", length=0.1, units=units)
    written = em.Rod(load="uniform", EI="2 N m^2", length="100 mm", units=units)
    assert named.units.value("length") == pytest.approx(written.units.value("length"), rel=1e-15)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: em.Strip("20 mm", 0.5, E="210 GPa", nu=0.3).properties(), "`thickness` must have"),
        (
            lambda: em.Rod(section=em.Round("2 mm", E="70 GPa", nu=0.3), length=0.3),
            "`length` must have a unit, as diameter = '2 mm' has one",
        ),
        (
            lambda: em.Rod(section=em.Round(2.0, E=7e10, nu=0.3), length="0.3 m"),
            "`diameter` must have a unit, as length = '0.3 m' has one",
        ),
    ],
)
def test_sections_have_units_on_all_lengths_or_on_none(make, said):
    with pytest.raises(em.InputError, match=said):
        make()
