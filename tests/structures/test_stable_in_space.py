"""What a user asks a rod about its plane: options, sections, names, events, wrong input."""

import numpy as np
import pytest

import equimorph as em
from equimorph.structures import from_identity
from equimorph.study import parse_study, prepare

STEEL = {"E": "210 GPa", "nu": 0.3, "density": 7850}
UNITS = {"force": "N", "length": "mm"}


def round_rod(**options):
    return em.Rod(torsion=0.77, lateral=1.0, **options)


@pytest.fixture(scope="module")
def beyond():
    """A round arch at q = 2, beyond its first lateral load of 1.6015."""
    rod = round_rod()
    return em.lift(rod.natural_state(Theta=0.9), {"q": 2.0}).end.state


# --- states --------------------------------------------------------------------------------------


def test_planar_stability_stays_what_it_was(beyond):
    assert beyond.stable
    assert beyond.index == 0
    assert not beyond.stable_in_space
    assert beyond.stable_in_space == "unstable"
    assert beyond.batch.index_out_of_plane.tolist() == [1]
    assert len(beyond.batch.stable) == 1
    assert len(beyond.batch.stable_in_space) == 0


def test_a_rod_without_stiffnesses_is_not_judged():
    state = em.Rod().natural_state(Theta=0.9)
    assert state.stable_in_space == "not judged"
    assert not state.stable_in_space
    with pytest.raises(em.InputError, match="must have stiffnesses out of its plane"):
        _ = state.batch.stable_in_space
    with pytest.raises(em.InputError, match="`torsion`, `lateral` must be given to judge"):
        em.Rod().lateral_margin()
    assert not hasattr(em.Rod(), "stable_in_space")
    assert not hasattr(state.batch, "index_out_of_plane")


def test_what_is_unstable_in_its_plane_is_unstable_in_space():
    found = em.find_equilibria(em.Rod(), {"Theta": 1.0, "q": 2.5, "Delta": 0.0}, seed=1)
    unstable = next(state for state in found if state.index > 0)
    assert unstable.stable_in_space == "unstable"


# --- descriptors ---------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "text",
    ["lateral_margin", "lateral_index", "lateral_margin(0.7, 2.5)", "lateral_index(0.7, 2.5)"],
)
def test_names_are_read_back(text, beyond):
    rod = beyond.structure
    descriptor = rod.descriptor(text)
    assert descriptor.name == text
    assert rod.descriptor(descriptor.name) == descriptor
    assert np.isfinite(descriptor(beyond))


def test_stiffnesses_of_their_own_ask_about_another_rod(beyond):
    strip = em.Rod(torsion=1.5, lateral=40.0)
    other = em.States(strip, beyond.z[None], beyond.p[None])
    mine = beyond.structure.lateral_margin(1.5, 40.0)
    assert mine(beyond) == pytest.approx(strip.lateral_margin()(other)[0], rel=1e-12)
    assert mine(beyond) > 0.0 > beyond.structure.lateral_margin()(beyond)


def test_the_mode_is_the_sideways_movement_of_the_margin(beyond):
    """∫ φ² + ψ² = 1 and z' = −ψ: trapezoidal sums over 401 points, 1e-5."""
    mode = beyond.structure.lateral_mode(beyond, 401)
    assert mode.margin == beyond.structure.lateral_margin()(beyond) < 0.0
    assert np.trapezoid(mode.twist**2 + mode.turn**2, mode.s) == pytest.approx(1.0, rel=1e-4)
    assert np.gradient(mode.z, mode.s)[1:-1] == pytest.approx(-mode.turn[1:-1], abs=1e-3)
    assert mode.z[[0, -1]] == pytest.approx(0.0, abs=1e-12)
    assert mode.z[200] > 0.0
    np.testing.assert_allclose(mode.z, mode.z[::-1], atol=1e-9)


def test_the_mode_of_a_rod_with_a_free_start_is_held_at_its_end():
    rod = em.Rod(
        ends=("free", "clamped"), loads={"P": em.PointForce(0.0)}, torsion=0.5, lateral=0.5
    )
    state = em.lift(rod.natural_state(), {"P": 0.02}).end.state
    mode = rod.lateral_mode(state, 11)
    assert mode.z[-1] == 0.0
    assert abs(mode.z[0]) > 0.1


# --- events --------------------------------------------------------------------------------------


def test_a_lift_tells_where_the_rod_leaves_its_plane():
    rod = round_rod()
    path = em.lift(rod.natural_state(Theta=0.9), {"q": 2.0})
    event, end = path.events
    assert (event.kind, event.criticality) == ("lateral branch point", "supercritical")
    assert event.state["q"] == pytest.approx(1.601471549048, abs=2e-11)
    assert event.at == pytest.approx(1.601471549048 / 2.0, abs=2e-11)
    assert end.kind == "arrived"
    assert len(em.lift(em.Rod().natural_state(Theta=0.9), {"q": 2.0}).events) == 1


def test_there_and_back_meets_the_point_twice():
    rod = round_rod()
    path = em.lift(rod.natural_state(Theta=0.9), [{"q": 2.0}, {"q": 1.0}])
    kinds = [event.kind for event in path.events]
    assert kinds == ["lateral branch point", "lateral branch point", "arrived"]
    first, second = (event.state["q"] for event in path.events[:2])
    assert first == pytest.approx(second, abs=1e-10)
    assert path.events[1].at == pytest.approx(1.0 + 2.0 - second, abs=1e-9)


def test_within_ends_lifts_and_limit_loads_there():
    rod = round_rod()
    state, within = rod.natural_state(Theta=0.9), [rod.stable_in_space, rod.max_curvature <= 10]
    one = em.limit_load(state, "q", within=within)
    many = em.limit_load(state.batch, "q", within=within)
    assert (one.kind, one.criticality) == ("lateral branch point", "supercritical")
    assert one.detail == "lateral_margin >= 0"
    assert (many.kind[0], many.criticality[0]) == (one.kind, one.criticality)
    assert many.value[0] == pytest.approx(one.value, abs=1e-11)
    assert one.path.end.state["q"] == one.value
    assert [event.kind for event in one.path.events] == ["lateral branch point"]


def test_limits_on_another_value_of_the_margin_are_constraints():
    rod = round_rod()
    found = em.limit_load(rod.natural_state(Theta=0.9), "q", within=[rod.lateral_margin() >= 0.01])
    assert found.kind == "constraint"
    assert found.criticality is None


def test_lanes_that_begin_beyond_met_nothing(beyond):
    lifts = em.lift(beyond.batch, {"q": 2.1}, within=[beyond.structure.stable_in_space])
    assert lifts.kind.tolist() == ["constraint"]


def test_an_end_couple_is_semi_tangential_and_not_judged_beyond_second_order():
    """M L/B = π √(A C) for a narrow cantilever; to 1e-6 = A C, the bending in the plane before."""
    rod = em.Rod(
        ends=("clamped", "free"), EI=1.0, length=1.0, loads={"M": em.Couple(1.0)},
        torsion=1e-3, lateral=1e-3,
    )  # fmt: skip
    found = em.limit_load(rod.natural_state(), "M", within=[rod.stable_in_space], bound=0.1)
    assert (found.kind, found.criticality) == ("lateral branch point", "not judged")
    assert found.value == pytest.approx(np.pi * 1e-3, rel=1e-6)


def test_maps_show_where_the_rod_leaves_its_plane():
    rod = round_rod()
    grid = em.Grid(Theta=(0.8, 1.0, 2), Delta=(-0.1, 0.1, 2))
    found = em.limit_load_map(rod, grid, "q", within=[rod.stable_in_space])
    assert found.where("lateral branch point").all()
    assert found.value[1, 1] == pytest.approx(1.601471549048, abs=2e-11)
    assert found.at(Theta=0.9, Delta=0.0).kind == "lateral branch point"


def test_sets_and_routes_keep_to_what_is_stable_in_space():
    """Cut at the lateral branch curve: all vertices obey, some lie on it."""
    rod = round_rod()
    eset = em.equilibrium_set(
        rod, em.Box(q=(0.0, 2.5)), fixed={"Theta": 0.9, "Delta": 0.0}, checks=0,
        within=[rod.max_curvature <= 5, rod.stable_in_space],
    )  # fmt: skip
    margin = rod.lateral_margin()(eset.points)
    assert margin.min() > -1e-9
    assert eset.points["q"][np.abs(margin) < 1e-9] == pytest.approx(1.601471549, abs=1e-8)
    assert eset.audit.clean


# --- sections ------------------------------------------------------------------------------------


def test_a_strip_has_the_stiffnesses_of_its_rectangle():
    """E w t³/12, E t w³/12; J of the series by the table of [TimoshenkoGoodier1970]_: 3 digits."""
    own = em.Strip("20 mm", "0.5 mm", **STEEL).properties(UNITS)
    assert pytest.approx(210e3 * 20 * 0.5**3 / 12) == own.EI
    assert own.EI_out == pytest.approx(210e3 * 0.5 * 20**3 / 12)
    assert pytest.approx(210e3 * 10) == own.EA
    assert own.weight == pytest.approx(7850e-9 * 9.80665 * 10)
    for ratio, k in ((1, 0.1406), (1.5, 0.196), (2, 0.229), (3, 0.263), (5, 0.291), (10, 0.312)):
        strip = em.Strip(float(ratio), 1.0, E=2.6, nu=0.3).properties()
        assert pytest.approx(k * ratio, abs=6e-4 * ratio) == strip.GJ


def test_a_section_is_the_same_on_either_side():
    """GJ does not know which side is the thickness."""
    one, other = (
        em.Strip(3.0, 2.0, 1.0, 0.3).properties(),
        em.Strip(2.0, 3.0, 1.0, 0.3).properties(),
    )
    assert one.GJ == other.GJ
    assert (one.EI, one.EI_out) == pytest.approx((other.EI_out, other.EI))


def test_thin_tubes_and_solid_ones_meet():
    solid = em.Round("10 mm", **STEEL).properties()
    tube = em.Tube("10 mm", "5 mm", **STEEL).properties()
    assert vars(tube) == pytest.approx(vars(solid), rel=1e-12)
    assert solid.torsion == pytest.approx(1 / 1.3)
    assert solid.lateral == 1.0


def test_a_rod_with_a_section_is_the_rod_with_its_stiffnesses():
    section = em.Strip("20 mm", "0.5 mm", **STEEL)
    rod = em.Rod(section=section, length="320 mm", units=UNITS)
    own = section.properties(UNITS)
    same = em.Rod(EI=own.EI, length=320.0, units=UNITS, torsion=f"{own.GJ} N mm^2",
                  lateral=own.EI_out / own.EI)  # fmt: skip
    assert rod.section == own
    state, other = (each.natural_state(Theta=0.9) for each in (rod, same))
    assert rod.lateral_margin()(state) == pytest.approx(same.lateral_margin()(other), rel=1e-12)
    again = from_identity(rod.identity())
    assert again.signature == rod.signature
    assert from_identity(same.identity()).signature == same.signature


def test_a_tables_kinks_are_ends_of_elements():
    rod = em.Rod(torsion=[[0, 1], [0.3, 1], [0.3, 2], [1, 2]], lateral=1.0)
    assert np.abs(rod.mesh.breaks - 0.3).min() < 1e-15
    assert from_identity(rod.identity()).signature == rod.signature


def test_tendons_of_stretchable_rods_pull_alike_in_any_unit():
    """T/EA is the strain of a straight rod with a tendon on its axis, whatever the unit of L."""
    for length in (1.0, 2.0, 300.0):
        rod = em.Rod(ends=("clamped", "free"), axial=100.0, EI=length**2, length=length,
                     actuators={"T": em.Tendon(0.0)})  # fmt: skip
        state = em.lift(rod.natural_state(), {"T": 1.0}).end.state
        assert rod.position(1.0)[0](state) == pytest.approx(0.99 * length, rel=1e-12)


def test_a_tendon_stiffens_the_rod_against_twist():
    """C + T d², in any unit of length."""
    for length in (1.0, 2.0):
        rod = em.Rod(ends=("clamped", "free"), EI=1.0, length=length, torsion=0.5, lateral=1.0,
                     actuators={"T": em.Tendon(0.3)})  # fmt: skip
        block = rod.out_of_plane()
        state = rod.natural_state(T=2.0)
        at = block.coefficients(state.z[None], state.p[None])
        stiff = at.torsion / block.model.nodal.rigidity  # relative to EI = 1
        np.testing.assert_allclose(stiff, 0.5 + 2.0 * 0.3**2, rtol=1e-12)


# --- wrong input ---------------------------------------------------------------------------------

WRONG = [
    (lambda: em.Rod(torsion=0.7), "`lateral` must be given together with `torsion`"),
    (lambda: em.Rod(torsion=-0.7, lateral=1), "`torsion` must be positive everywhere; got -0.7"),
    (lambda: em.Rod(torsion="2 N m^2", lateral=1), "`units` must be given where a quantity"),
    (
        lambda: em.Rod(EI=1.0, length=1.0, torsion="2 N m", lateral=1),
        "`torsion` must be in units of force·length², like N m²; got '2 N m'",
    ),
    (lambda: em.Strip("20 mm", "-1 mm", **STEEL), "`thickness` must be positive"),
    (lambda: em.Strip("20 mm", "1 mm", E="2 GPa", nu=0.6), "`nu` must be Poisson's ratio"),
    (lambda: em.Strip("20 kg", "1 mm", **STEEL).properties(), "`width of the strip` must be in"),
    (
        lambda: em.Round("2 mm", E="1 GPa", nu=0.3, density="3 N").properties(),
        "`density of the round` must be in units of force/length³",
    ),
    (lambda: em.Tube("2 mm", "2 mm", **STEEL).properties(), "`wall` of the tube must be at most"),
    (lambda: em.Rod(section="strip", length=1.0), "`section` must be a section"),
    (
        lambda: em.Rod(section={"kind": "round", "d": 1}, length=1.0),
        "`Round` must have arguments among diameter, E, nu, density; got d",
    ),
    (
        lambda: em.Rod(section=em.Round(1.0, 1.0, 0.3)),
        "`length` must be given together with `section`",
    ),
    (
        lambda: em.Rod(section=em.Round(1.0, 1.0, 0.3), length=1.0, EI=2.0),
        "`EI` must be left out for a rod with a section",
    ),
    (
        lambda: em.Rod(loads={"p": em.Pressure()}, torsion=0.7, lateral=1.0),
        "`torsion`, `lateral` must be left out for rods under the pressure `p`",
    ),
    (
        lambda: em.Rod(loads={"p": em.Pressure()}).lateral_margin(0.7, 1.0),
        "`torsion`, `lateral` must be left out for rods under the pressure `p`",
    ),
    (
        lambda: em.Rod().descriptor("lateral_margin(0.7)"),
        "lateral_index(torsion,lateral)",
    ),
]


@pytest.mark.parametrize(("make", "message"), WRONG)
def test_wrong_input_gets_one_line(make, message):
    with pytest.raises(em.InputError) as error:
        make()
    assert message in str(error.value)
    assert "\n" not in str(error.value)


# --- studies -------------------------------------------------------------------------------------

STUDY = """
[structure]
kind = "rod"
section = { kind = "strip", width = "20 mm", thickness = "0.5 mm", E = "210 GPa", nu = 0.3 }
length = "320 mm"
units = { force = "N", length = "mm" }
[set]
box = { Theta = [0.5, 1.0] }
fixed = { Delta = 0.0, q = 0.0 }
within = ["lateral_margin >= 0", "max_curvature <= 0.05"]
"""


def test_studies_name_sections_and_the_lateral_margin():
    problem = prepare(parse_study(STUDY, "strip.toml"))
    rod = problem.ground.structure
    assert pytest.approx(43750.0) == rod.section.EI
    assert problem.ground.extent.constraints[0] == rod.stable_in_space
    assert problem.ground.extent.constraints[0].event == "lateral branch point"


def test_a_wrong_section_of_a_study_is_told_by_its_key():
    wrong = STUDY.replace('kind = "strip"', 'kind = "stripe"')
    with pytest.raises(
        em.InputError, match=r"`section` must be .* got 'stripe'. Did you mean strip"
    ):
        prepare(parse_study(wrong, "strip.toml"))
