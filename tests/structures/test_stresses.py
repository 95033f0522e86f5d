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
