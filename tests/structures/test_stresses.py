"""Strain, stress and safety of rods made from sections."""

import math

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import MissingError
from equimorph.structures.quantities import find_descriptor
from equimorph.structures.unit_system import unit_system

STEEL = em.Strip("20 mm", "0.5 mm", E="210 GPa", nu=0.3)
UNITS = {"force": "N", "length": "mm"}


@pytest.fixture(scope="module")
def strip() -> em.Rod:
    return em.Rod(section=STEEL, length="320 mm", units=UNITS, elements=4, degree=5)


@pytest.fixture(scope="module")
def arc(strip) -> em.State:
    """At Θ = 1 the span L sin 1 of the natural state is that of a circular arc, κ = 2Θ/L."""
    return strip.natural_state(Theta=1.0)


def test_an_arc_has_the_strain_of_its_curvature(strip, arc):
    """Closed form: ε = κ t/2 = Θ t/L; σ = E ε."""
    strain = 0.5 / 320.0
    assert strip.max_strain(arc) == pytest.approx(strain, rel=1e-9)
    assert strip.max_stress(arc) == pytest.approx(210e3 * strain, rel=1e-9)
    assert strip.max_stress.unit == "N/mm²"


def test_stress_is_moment_over_section_modulus(strip, arc):
    """Independent of the curvature: σ = M/W with W = w t²/6, and the couple M of the clamp."""
    modulus = 20.0 * 0.5**2 / 6.0
    moment = abs(strip.end_moment(0)(arc))
    assert strip.max_stress(arc) == pytest.approx(moment / modulus, rel=1e-9)


@pytest.mark.parametrize(
    ("section", "size"),
    [(em.Round("2 mm", E="70 GPa", nu=0.33), 2.0),
     (em.Tube("10 mm", "1 mm", E="70 GPa", nu=0.3), 10.0)],
)  # fmt: skip
def test_round_sections_bear_the_strain_at_their_outside(section, size):
    rod = em.Rod(section=section, length="2 m", units=UNITS, elements=4, degree=5)
    assert rod.max_strain(rod.natural_state(Theta=1.0)) == pytest.approx(size / 2000.0, rel=1e-9)


def test_a_safety_factor_is_strength_over_stress(strip, arc):
    stress = strip.max_stress(arc)
    assert strip.safety_factor("900 MPa")(arc) == pytest.approx(900.0 / stress, rel=1e-12)
    assert strip.safety_factor(900.0)(arc) == strip.descriptor("safety_factor(900 MPa)")(arc)
    straight = strip.natural_state(Theta=1.0).z * 0.0
    value = strip.safety_factor("900 MPa").function(straight[None], arc.p[None])
    assert np.isfinite(value).all()


def test_a_bound_of_the_stress_ends_a_path_where_that_of_the_curvature_does(strip, arc):
    """Identity: σ ≤ E t κ/2 is the same constraint as the curvature κ."""
    curvature = 0.0075
    bounds = (strip.max_curvature <= curvature, strip.max_stress <= "393.75 MPa",
              strip.safety_factor("787.5 MPa") >= 2.0)  # fmt: skip
    ends = [em.limit_load(arc, "q", within=[bound]) for bound in bounds]
    assert [end.kind for end in ends] == ["constraint"] * 3
    np.testing.assert_allclose([end.value for end in ends], ends[0].value, rtol=1e-7)


@pytest.mark.parametrize(
    ("rod", "words"),
    [
        (em.Rod, "got a rod without the size of its section"),
        (lambda: em.Rod(section=em.OwnSection(1.0, 1.0, 1.0), length=1.0), "without the size of"),
        (lambda: em.Rod(section=STEEL, length="320 mm", units=UNITS, curvature="0.001 1/mm"),
         "that is straight when free of stress"),
        (lambda: em.Rod(section=STEEL, length="320 mm", units=UNITS,
                        actuators={"h": em.Curvature()}), "that is straight when free of stress"),
        (lambda: em.SpatialRod(torsion=0.8, lateral=1.0), "without the size of"),
        (lambda: em.SpatialRod(section=STEEL, length="320 mm", units=UNITS, natural_twist=0.001),
         "that is straight when free of stress"),
    ],
)  # fmt: skip
def test_strain_of_other_rods_is_refused(rod, words):
    with pytest.raises(MissingError, match=words):
        rod().descriptor("max_strain")


@pytest.mark.parametrize("strength", [0.0, -1.0, "300 N", "strong", math.nan])
def test_a_strength_is_a_positive_stress(strip, strength):
    with pytest.raises(em.InputError, match="strength"):
        strip.safety_factor(strength)


def test_errors_that_list_descriptors_list_those_of_every_structure():
    for structure in (em.Spring(), em.Rod()):
        with pytest.raises(em.InputError, match=r"energy.*, stability_margin, abs\(…\).*; got 'x'"):
            find_descriptor(structure, "x")


def test_efforts_have_symbols_and_units(strip):
    """Couples M, forces F, and the travel of loads; nothing is per an angle."""
    spring, plain = em.Spring(), em.Rod(load="uniform")
    told = [(em.effort_of(rod, name).symbol, em.effort_of(rod, name).unit) for rod, name in
            ((strip, "Theta"), (strip, "q"), (plain, "Delta"), (plain, "q"), (spring, "x_l"),
             (spring, "F"))]  # fmt: skip
    assert told == [("M(Theta)", "N mm"), ("Q(q)", "mm²"), ("M(Delta)", "4π²B/L"), ("−δ(q)", "L"),
                    ("F(x_l)", "force"), ("−δ(F)", "length")]  # fmt: skip


def test_a_bound_of_stress_bounds_a_set_as_one_of_curvature_does(strip):
    """A proposal is in the user's units: 20/L."""
    for bound in (strip.max_stress <= 600.0, strip.max_strain <= 0.01, strip.max_curvature <= 0.1,
                  strip.safety_factor("900 MPa") >= 1.5):  # fmt: skip
        assert strip.missing_bound([bound]) == ""
    assert strip.missing_bound([strip.max_stress >= 1.0]) == "max_curvature <= 0.0625"


# --- in space -------------------------------------------------------------------------------------

WIRE = em.Round("2 mm", E="70 GPa", nu=0.33)


@pytest.mark.parametrize("section", [STEEL, WIRE])
def test_a_planar_state_bears_in_space_what_it_bears_in_its_plane(section):
    """The same rod as a planar one; 1e-6: both discretisations."""
    rod = em.SpatialRod(section=section, length="320 mm", units=UNITS, elements=3, degree=5)
    flat = em.Rod(section=section, length="320 mm", units=UNITS, elements=4, degree=5)
    bent, arc = rod.natural_state(Theta=1.0), flat.natural_state(Theta=1.0)
    for one in (rod.max_strain, rod.max_stress, rod.safety_factor("900 MPa")):
        assert one(bent) == pytest.approx(flat.descriptor(one.name)(arc), rel=1e-6)


def test_a_wire_bears_the_stress_of_its_couples():
    """Bent and twisted, unloaded: M(s) = r × F − M_A, and σ = √((M r/I)² + 3 (T r/J)²).

    1e-5: the largest of 2001 arclengths.
    """
    wire = em.SpatialRod(section=WIRE, length="320 mm", units=UNITS, elements=3, degree=5)
    flat = wire.natural_state(Theta=1.0)
    turned = em.lift(flat, {"twist_A": 1.0, "Theta": 0.8}).end.state
    z, p, s = turned.z[None], turned.p[None], np.linspace(0.0, 1.0, 2001)
    couple = np.array([wire.end_couple(0, axis)(turned) for axis in "xyz"])
    force = np.array([wire.support_force(axis)(turned) for axis in "xyz"])
    moments = np.cross(wire.places(z, p, s)[0], force) - couple
    twist, *bends = np.einsum("sia,si->as", wire.frames(z, p, s)[0], moments)
    assert np.abs(twist).min() > 20.0
    stress = np.hypot(np.hypot(*bends), 0.5 * np.sqrt(3.0) * twist) / (np.pi / 4.0)
    assert wire.max_stress(turned) == pytest.approx(stress.max(), rel=1e-5)
    bound = wire.max_stress <= 0.9 * stress.max()
    assert em.lift(flat, {"twist_A": 1.0, "Theta": 0.8}, within=[bound]).end.kind == "constraint"


@pytest.mark.parametrize(
    ("ratio", "share"), [(1.0, 0.675), (1.2, 0.759), (1.5, 0.848), (2.0, 0.930), (4.0, 0.997)]
)
def test_a_twisted_rectangle_bears_the_printed_shear(ratio, share):
    """τ = k G κ t in the middle of the long side [TimoshenkoGoodier1970]_, table of section 109."""
    for width, thickness in ((ratio, 1.0), (1.0, ratio)):
        section = em.Strip(width, thickness, E=2.6, nu=0.3).fibres(unit_system(None))
        twisted = np.array([[[1.0, 0.0, 0.0]]])
        assert section.stress(twisted).item() == pytest.approx(np.sqrt(3.0) * share, abs=1e-3)
        bent = np.array([[[0.0, 0.5, 0.25]]])  # the corner
        assert section.strain(bent).item() == pytest.approx(0.25 * width + 0.125 * thickness)
        assert section.stress(bent).item() == pytest.approx(2.6 * section.strain(bent).item())


# --- members of frames ----------------------------------------------------------------------------

ROUND = em.Round("4 mm", E="70 GPa", nu=0.33)
AREA, MODULUS = 4.0 * np.pi, 2.0 * np.pi
"""A = π d²/4 and W = π d³/32 of it."""
LINE = {"A": (0, 0), "B": (300, 0)}


def test_a_planar_member_bears_what_statics_say():
    """A cantilever under a couple and a pull along it: σ = N/A + M/W, at any size of the bend.

    Two members of unlike thickness in a row: each by itself, and the largest of both.
    """
    thick = em.Strip("20 mm", "2 mm", E="210 GPa", nu=0.3)
    members = [em.Member(("A", "B"), section=ROUND), em.Member(("B", "C"), section=thick)]
    frame = em.Frame({**LINE, "C": (500, 0)}, members, {"A": "fixed"},
                     {"M": {"C": (0, 0, 1)}, "P": {"C": (1, 0)}}, units=UNITS)  # fmt: skip
    bent = em.lift(frame.natural_state(), {"M": 500.0}).end.state
    wire, strip = (frame.descriptor(f"max_stress({name})") for name in ("A-B", "B-C"))
    assert wire(bent) == pytest.approx(500.0 / MODULUS, rel=1e-9)
    assert strip(bent) == pytest.approx(500.0 / (20.0 * 2.0**2 / 6.0), rel=1e-9)
    assert frame.max_stress(bent) == pytest.approx(500.0 / MODULUS, rel=1e-9)
    assert frame.max_strain(bent) == pytest.approx(500.0 / MODULUS / 70e3, rel=1e-9)
    assert frame.descriptor("safety_factor(300 MPa)")(bent) == pytest.approx(
        300.0 * MODULUS / 500.0, rel=1e-9
    )
    pulled = em.lift(frame.natural_state(), {"P": 50.0}).end.state
    assert frame.max_stress(pulled) == pytest.approx(50.0 / AREA, rel=1e-9)
    assert strip(pulled) == pytest.approx(50.0 / 40.0, rel=1e-9)
    assert wire.unit == "N/mm²"
    largest = em.limit_load(frame.natural_state(), "M", within=[frame.max_stress <= "100 MPa"])
    assert largest.value == pytest.approx(100.0 * MODULUS, rel=1e-6)


def test_arcs_and_actuated_curvatures_are_free_of_stress():
    """A cantilever that is bent by its own strains alone bears nothing."""
    arc = em.Member(("A", "B"), section=ROUND, curvature=0.002)
    frame = em.Frame(LINE, [arc], {"A": "fixed"}, actuators={"a": {"curvature": {"A-B": 0.001}}},
                     units=UNITS)  # fmt: skip
    turned = em.lift(frame.natural_state(), {"a": 2.0}).end.state
    assert frame.max_curvature(turned) == pytest.approx(0.004, rel=1e-9)
    assert frame.max_stress(turned) < 1e-6


def test_a_bend_in_space_bears_bending_and_twist():
    """A right-angled bend under P across it: at the clamp σ = √((P a/W)² + 3 (P b/(2W))²).

    1e-6: P is small, and the bend moves by 1e-4 of its lengths.
    """
    joints = {"A": (0, 0, 0), "B": (300, 0, 0), "C": (300, 200, 0)}
    member = em.SpatialMember(("A", "B", "C"), section=ROUND)
    loads = {"P": {"C": (0, 0, -1)}, "N": {"B": (1, 0, 0)}}
    frame = em.SpatialFrame(joints, [member], {"A": "fixed"}, loads, units=UNITS)
    bent = em.lift(frame.natural_state(), {"P": 0.001}).end.state
    stress = 0.001 / MODULUS * np.hypot(300.0, 0.5 * np.sqrt(3.0) * 200.0)
    assert frame.max_stress(bent) == pytest.approx(stress, rel=1e-6)
    assert frame.descriptor("max_strain(A-B-C)")(bent) == pytest.approx(
        0.001 * 300.0 / MODULUS / 70e3, rel=1e-6
    )
    assert frame.max_stress(em.lift(frame.natural_state(), {"N": 20.0}).end.state) == pytest.approx(
        20.0 / AREA, rel=1e-9
    )


@pytest.mark.parametrize("section", [STEEL, ROUND])
def test_a_planar_frame_bears_in_space_what_it_bears_in_its_plane(section):
    """A portal with hinges and a strut in tension and compression; 1e-7: both discretisations."""
    flat = {"A": (0, 0), "B": (0, 200), "C": (250, 200), "D": (250, 0)}
    pairs = [("A", "B"), ("B", "C"), ("C", "D"), ("B", "D")]
    load, stress = {"F": {"B": (2e-3, -1e-3)}}, []
    for kind, member, zero in (
        (em.Frame, em.Member, ()),
        (em.SpatialFrame, em.SpatialMember, (0,)),
    ):
        more = {"normal": (0.6, 0.8, 0)} if zero else {}
        hinges = {"B": (0, 0, 1), "D": "ball"} if zero else pairs[3]
        made = [member(each, section=section, **more) for each in pairs[:3]]
        made.append(member(pairs[3], section=section, hinges=hinges, **more))
        loads = {name: {j: (*v, *zero) for j, v in given.items()} for name, given in load.items()}
        frame = kind({j: (*v, *zero) for j, v in flat.items()}, made,
                     {"A": "fixed", "D": "fixed"}, loads, units=UNITS)  # fmt: skip
        state = em.lift(frame.natural_state(), {"F": 10.0}).end.state
        names = ["max_stress", "max_strain", *(f"max_stress({a}-{b})" for a, b in pairs)]
        stress.append([frame.descriptor(name)(state) for name in names])
        assert len(set(stress[-1])) >= 5
    np.testing.assert_allclose(stress[1], stress[0], rtol=1e-7)


def test_strain_of_a_member_without_section_is_refused_by_name():
    members = [em.Member(("A", "B"), section=ROUND), em.Member(("B", "C"), EI="1 N m^2")]
    frame = em.Frame({**LINE, "C": (500, 0)}, members, {"A": "fixed"}, {"P": {"C": (0, 1)}},
                     units=UNITS)  # fmt: skip
    with pytest.raises(MissingError, match="got member B-C without the size of its section"):
        frame.descriptor("max_stress")
    assert frame.descriptor("max_stress(A-B)").unit == "N/mm²"
    with pytest.raises(em.InputError, match=r"`EI` of member A-B must be left out beside"):
        em.Member(("A", "B"), EI=1.0, section=ROUND)
    again = em.structures.from_identity(frame.identity())
    assert again.signature == frame.signature
