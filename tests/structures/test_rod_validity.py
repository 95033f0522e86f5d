"""Where the planar model of a rod ends."""

import numpy as np
import pytest

import equimorph as em

TIP = {"P": em.PointForce(1.0)}


def cantilever(**options):
    return em.Rod(ends=("clamped", "free"), EI=1.0, length=1.0, **options)


@pytest.mark.parametrize(("torsion", "lateral"), [(1e-3, 1e-3), (4e-3, 1e-3)])
def test_a_narrow_cantilever_tips_over_at_prandtls_load(torsion, lateral):
    """P L² = 4.0126 √(A C), to first order in A/B and C/B: the strip hardly bends before."""
    rod = cantilever(loads=TIP)
    critical = 4.0126 * np.sqrt(torsion * lateral)
    margin = rod.lateral_margin(torsion, lateral)
    path = em.lift(rod.natural_state(), {"P": 1.3 * critical}, within=[margin >= 0.0])
    assert path.end.kind == "lateral branch point"
    assert path.end.state["P"] == pytest.approx(critical, rel=4e-3)


def test_a_column_buckles_about_its_weaker_axis():
    """P = π² A/4 for a cantilever, 4 π² A for clamped ends that stay in the plane."""
    push = {"P": em.PointForce(1.0, (-1.0, 0.0))}
    free = cantilever(loads=push)
    margin = free.lateral_margin(1.0, 0.5)
    path = em.lift(free.natural_state(), {"P": 1.3}, within=[margin >= 0.0])
    assert path.end.state["P"] == pytest.approx(0.5 * np.pi**2 / 4, rel=1e-8)
    clamped = em.Rod(ends=("clamped", "sliding"), loads=push, EI=1.0, length=1.0)
    margin = clamped.lateral_margin(1.0, 0.5)
    path = em.lift(clamped.natural_state(), {"P": 25.0}, within=[margin >= 0.0])
    assert path.end.state["P"] == pytest.approx(0.5 * 4 * np.pi**2, rel=1e-8)


def test_the_margin_of_the_arch_is_that_of_the_same_general_rod():
    """Two ways to the same second variation: 1e-9."""
    arch, general = em.Rod(), em.Rod(loads={"q": em.LineLoad()})
    state = em.lift(arch.natural_state(Theta=0.9), {"q": 1.0}).end.state
    other = em.lift(general.natural_state(Theta=0.9), {"q": 1.0}).end.state
    one, two = (rod.lateral_margin(0.7, 1.0) for rod in (arch, general))
    assert one(state) == pytest.approx(two(other), rel=1e-9)
    assert one(state) > 0.0
    assert arch.warnings(state, torsion=0.7, lateral=1.0) == ()


def test_stress_free_rods_do_not_buckle_out_of_their_plane():
    """Without forces the second variation is a sum of squares."""
    rod = em.Rod(ends=("clamped", "free"), curvature=5.0)
    assert rod.lateral_margin(0.1, 0.1)(rod.natural_state()) > 0.0


def test_the_clearance_of_a_hairpin_is_the_distance_of_its_legs():
    """Straight, half a circle of radius r, straight: 2 r between the legs. Third order: 1e-6."""
    r, turn = 0.08, 0.08 * np.pi
    start, stop = 0.5 - turn / 2, 0.5 + turn / 2
    hairpin = em.Rod(ends=("clamped", "free"), actuators={"k": em.Curvature(1.0, start, stop)})
    state = hairpin.natural_state(k=1 / r)
    assert hairpin.clearance(0.4)(state) == pytest.approx(2 * r, rel=1e-6)
    assert hairpin.warnings(state) == ()
    (line,) = hairpin.warnings(state, thickness=0.17)
    assert "touches itself" in line
    assert hairpin.descriptor("clearance(0.4)") == hairpin.clearance(0.4)


def test_a_loop_that_crosses_itself_has_no_clearance():
    """More than a turn, tighter in the middle: the ends cross. Polished below 1e-9."""
    rod = em.Rod(ends=("clamped", "free"), curvature=[[0, 5.0], [0.5, 9.0], [1, 5.0]])
    state = rod.natural_state()
    assert rod.clearance()(state) == pytest.approx(0.0, abs=1e-9)
    assert len(rod.warnings(state)) == 1


def test_the_clearance_of_a_straight_rod_is_the_least_distance_along_it():
    rod = em.Rod(ends=("clamped", "free"))
    assert rod.clearance(0.125)(rod.natural_state()) == pytest.approx(0.125, rel=1e-10)


@pytest.mark.parametrize("apart", [0.1, 0.3, 0.7])
def test_the_clearance_of_an_arc_is_the_chord_of_the_least_difference(apart):
    """2 R sin(s/2R) at any s, also no multiple of the spacing h of samples; error κ³ h⁴."""
    for length in (1.0, 40.0):
        ends = ("clamped", "free")
        rod = em.Rod(ends=ends, curvature=3.0 / length, EI=1.0, length=length, loads={})
        chord = 2.0 / 3.0 * length * np.sin(1.5 * apart)
        assert rod.clearance(apart)(rod.natural_state()) == pytest.approx(chord, rel=2e-7)


def test_clearances_are_those_of_dense_samples():
    """Ends that come near the rod, and stretched rods; 1e-5: samples 1/2000 apart."""
    s, rng = np.linspace(0.0, 1.0, 2001), np.random.default_rng(0)
    for k in range(8):
        bend = rng.uniform(3.0, 9.0) * rng.uniform(0.5, 1.5, 2)
        table = [[0.0, bend[0]], [1.0, bend[1]]]
        rod = em.Rod(ends=("clamped", "free"), curvature=table, axial=[None, 5.0][k % 2])
        state = em.lift(rod.natural_state(), {"q": 0.05}).end.state
        places = rod.shape(state.z[None], state.p[None], s)[0]
        far = s - s[:, None] >= 0.25 - 1e-12
        exact = np.linalg.norm(places[:, None] - places, axis=2)[far].min()
        assert rod.clearance(0.25)(state) == pytest.approx(exact, abs=1e-5)


def test_the_clearance_of_a_sheared_rod_is_that_of_dense_samples():
    """Shear of 30 %; 3e-4: samples 1/4000 apart that differ by `apart`. It was off by 1.3e-3."""
    load = {"P": em.PointForce(1.0, (-1.0, -0.5, 0.6))}
    soft = {"axial": 30.0, "shear": 1.0, "torsion": 0.8, "lateral": 1.0}
    rod = em.SpatialRod(ends=("clamped", "free"), curvature=8.0, loads=load, **soft)
    state = em.lift(rod.natural_state(), {"P": 0.4}).end.state
    places = rod.shape(state.z[None], state.p[None], np.linspace(0.0, 1.0, 4001))[0]
    for steps in (1200, 2000, 2800):
        rows = places[: 4001 - steps]
        least = min(
            np.linalg.norm(places[k + steps :: 4] - row, axis=1).min()
            for k, row in zip(range(0, len(rows), 4), rows[::4], strict=True)
        )
        assert rod.clearance(steps / 4000)(state) == pytest.approx(least, abs=3e-4)


def test_distances_of_a_stretched_rod_are_those_of_dense_samples():
    """Strains of 20 % in the plane, shear in space; 1e-6: that of samples 1/20000 apart."""
    ends = ("clamped", "free")
    load = {"P": em.PointForce(1.0, (1.0, 0.3))}
    planar = em.Rod(ends=ends, axial=3.0, curvature=7.0, loads=load)
    soft = {"axial": 20.0, "shear": 3.0, "torsion": 0.8, "lateral": 1.0}
    across = {"P": em.PointForce(1.0, (0.5, 0.3, 0.4))}
    for rod in (planar, em.SpatialRod(ends=ends, curvature=4.0, loads=across, **soft)):
        state = em.lift(rod.natural_state(), {"P": 0.6}).end.state
        places = rod.shape(state.z[None], state.p[None], np.linspace(0.0, 1.0, 20001))[0, :, :2]
        for centre in places[1000::4000] + np.array([0.07, 0.05]):
            exact = np.linalg.norm(places - centre, axis=1).min() - 0.01
            away = em.distance_to(rod, em.Disc(tuple(centre.tolist()), 0.01))
            assert away(state) == pytest.approx(exact, abs=1e-6)


def test_wrong_input_gets_one_line():
    rod = em.Rod()
    with pytest.raises(em.InputError, match="`apart` must be a share of the rod's length"):
        rod.clearance(1.5)
    with pytest.raises(em.InputError, match="`torsion` must be positive everywhere; got -1"):
        rod.lateral_margin(-1.0, 1.0)
