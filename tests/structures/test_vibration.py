"""Physical mass matrices and natural frequencies against closed forms and a chain of links."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.structures import from_identity

CANTILEVER = np.array([1.8751040687, 4.6940911330, 7.8547574382])
"""Roots of cos β cosh β = −1: ω = β² √(B/(ρA L⁴))."""
FORCE = [em.Parameter("F", "", 1.0, "load")]
PAIRS = (("A", "B"), ("B", "C"))
LOADED = {"P": em.PointForce(1.0)}


def chain_frequencies(state, links):
    """Angular frequencies of N hinged links with stiffness N B, half a link at each clamp.

    Second variation ``½ Σ k_i δ(θ_{i+1} − θ_i)²`` plus load and support forces, lumped masses at
    the middle of links; an independent model of second order.
    """
    h, stiff = 1.0 / links, links / (4.0 * np.pi**2)
    s = (np.arange(links) + 0.5) * h
    theta = np.array([state.structure.angle(x)(state) for x in s])
    (lam, mu), q = state.multipliers, state["q"]
    springs = np.full(links + 1, stiff)
    springs[[0, -1]] *= 2.0
    bend = np.diag(springs[:-1] + springs[1:])
    bend -= np.diag(springs[1:-1], 1) + np.diag(springs[1:-1], -1)
    weight = q * s * h
    bend += np.diag((weight - mu * h) * np.sin(theta) - lam * h * np.cos(theta))
    closing = h * np.stack([-np.sin(theta), np.cos(theta)])
    lower = np.tril(np.full((links, links), h), -1) + np.diag(np.full(links, 0.5 * h))
    places = np.concatenate([lower * -np.sin(theta), lower * np.cos(theta)])
    free = np.linalg.svd(closing)[2][2:].T
    stiffness, mass = free.T @ bend @ free, h * (places @ free).T @ (places @ free)
    half = np.linalg.inv(np.linalg.cholesky(mass))
    return np.sqrt(np.linalg.eigvalsh(half @ stiffness @ half.T))


@pytest.fixture(scope="module")
def upright():
    """The arch at (1, 0), q = 2.5."""
    rest = em.Rod(load="uniform").natural_state(Theta=1.0, Delta=0.0)
    return em.lift(rest, {"q": 2.5}).end.state


def test_frequencies_of_a_cantilever_are_those_of_the_closed_form():
    """[Blevins] T = L² √(ρA/B)/(2π), so ω T = β²/(2π). 1e-7: six elements of degree 9."""
    rod = em.Rod(ends=("clamped", "free"), loads=LOADED)
    exact = CANTILEVER**2 / (2.0 * np.pi)
    found = rod.natural_state().natural_frequencies(3)
    np.testing.assert_allclose(found, exact, rtol=1e-7)


@pytest.mark.parametrize(
    "given",
    [
        {"EI": 2.0, "length": 3.0, "mass": "600 g"},
        {"EI": 2.0e9, "length": 3000.0, "mass": 0.6, "units": {"force": "mN", "length": "mm"}},
        {"EI": "2 N m^2", "length": "3 m", "mass": 0.6, "units": {"force": "kN", "length": "cm"}},
        {
            "section": em.OwnSection("2 N m^2", "2 N m^2", "2 N m^2", weight="0.2 kg/m"),
            "length": "3 m",
            "units": {"force": "N", "length": "m"},
        },
    ],
    ids=["SI", "mN and mm", "kN and cm", "section"],
)
def test_frequencies_with_units_are_in_radians_per_second(given):
    """The same cantilever with B = 2 N m², L = 3 m, 0.6 kg in several systems of units."""
    rod = em.Rod(ends=("clamped", "free"), loads=LOADED, **given)
    exact = CANTILEVER[:2] ** 2 * np.sqrt(2.0 / (0.2 * 3.0**4))
    np.testing.assert_allclose(rod.natural_state().natural_frequencies(2), exact, rtol=1e-6)
    assert rod.time_unit == "s"
    again = from_identity(rod.identity())
    np.testing.assert_allclose(again.natural_state().natural_frequencies(2), exact, rtol=1e-6)


def test_an_axially_loaded_column_softens_until_it_buckles():
    """Sliding cantilever ends: clamped-guided column, ω² = ω₀² (1 − P/P_cr), P_cr = π²B/L².

    The guided end keeps angle and y, moves in x: modes are those of a clamped–clamped column whose
    first frequency falls to zero at λ = 1 (units of 4π²B/L²). Galerkin's mode is not exact: 2 %.
    """
    push = {"P": em.PointForce(1.0, direction=(-1.0, 0.0))}
    rod = em.Rod(ends=("clamped", "sliding"), loads=push)
    rest = rod.natural_state()
    squares = []
    for load in (0.0, 0.5, 0.9, 0.99):
        state = rest if load == 0.0 else em.lift(rest, {"P": load}).end.state
        squares.append(float(state.natural_frequencies()[0] ** 2))
    exact = (4.7300407449**2 / (2.0 * np.pi)) ** 2
    assert squares[0] == pytest.approx(exact, rel=1e-7)
    np.testing.assert_allclose(np.array(squares) / exact, [1.0, 0.5, 0.1, 0.01], atol=0.02)


def test_arch_vibrates_like_a_chain_of_links(upright):
    """An independent chain of N links, extrapolated in N⁻²; 5.49/T was measured in a simulator."""
    coarse, fine = (chain_frequencies(upright, n)[:3] for n in (60, 120))
    found = upright.natural_frequencies(3)
    np.testing.assert_allclose(found, (4.0 * fine - coarse) / 3.0, rtol=2e-5)
    assert found[0] == pytest.approx(5.49, abs=0.005)


def test_general_rod_equals_the_arch(upright):
    """The same rod by general mechanics; with EA = 1e6 nearly so, by 1/EA."""
    exact = upright.natural_frequencies(3)
    for axial, near in ((None, 1e-9), (1e6, 2e-5)):
        rod = em.Rod(load="uniform", coordinates={}, axial=axial)
        rest = rod.natural_state(theta_A=1.0, theta_B=-1.0)
        state = em.lift(rest, {"q": 2.5}).end.state
        np.testing.assert_allclose(state.natural_frequencies(3), exact, rtol=near)


@pytest.mark.parametrize(
    "options",
    [
        {"ends": ("clamped", em.End(x=30.0, y=20.0))},
        {"ends": (em.End(x=5.0, angle=3.0), "clamped")},
        {"ends": (em.End("free", slide=0.3), "clamped")},
        {"ends": ("pinned", em.End(angle=2.0, x="free"))},
    ],
    ids=["sprung B", "sprung A", "inclined", "pinned"],
)
def test_mass_matrix_is_that_of_the_places(options):
    """Kinetic energy of the places, differenced along a path of equilibria under a small load.

    Along the path all equations hold, so that J u̇ is the change of `shape`, which integrates the
    rod's equations by itself. 1e-4: central differences, and elements between the nodes.
    """
    rod = em.Rod(loads={"q": em.LineLoad("uniform")}, coordinates={}, elements=8, **options)
    q = [each.name for each in rod.parameters].index("q")
    rest = rod.natural_state(
        **{each.name: 0.4 for each in rod.parameters if each.name in ("theta_A",)}
    )
    state = em.lift(rest, {"q": 0.3}).end.state
    z, p = state.z[None], state.p[None]
    dp = np.zeros_like(p)
    dp[0, q] = 1.0
    dz = rod.solve(z, p, -rod.parameter_derivative(z, p, dp)[:, None]).x[:, 0]
    velocity = dz[:, : rod.unknowns]
    kinetic = velocity @ rod.inertia(z, p)[0] @ velocity[0]
    h, s = 1e-4, rod.mesh.nodes
    ends = []
    for sign in (1.0, -1.0):
        moved = em.lift(state, {"q": state["q"] + sign * h}).end.state
        ends.append(moved.shape(s))
    rate = (ends[0] - ends[1]) / (2.0 * h)
    exact = (rod.mesh.weights[:, None] * rate**2).sum()
    assert float(kinetic[0]) == pytest.approx(exact, rel=1e-4)


@pytest.mark.parametrize("ends", [("clamped", "clamped"), ("pinned", "clamped")])
def test_mass_matrix_of_a_stretched_rod_is_that_of_its_places(ends):
    """Places ``∫ (1 − N/EA)(cos θ, sin θ)`` with N = λ cos θ + (μ − q s) sin θ.

    Angles move at random and the forces follow by the closing conditions. 1e-6: differences.
    """
    stiff = 40.0
    rod = em.Rod(load="uniform", coordinates={}, axial=stiff, elements=3, degree=6, ends=ends)
    state = em.lift(rod.natural_state(theta_B=-0.5), {"q": 0.8}).end.state
    (z,), n, s = state.batch.z, rod.unknowns, rod.mesh.nodes
    integral = rod.mesh.integration(s)

    def places(z):
        theta = rod.nodal_angles(z[None], state.p[None])[0]
        (lam, mu), sine, cosine = z[n:], np.sin(theta), np.cos(theta)
        stretch = 1.0 - (lam * cosine + (mu - state["q"] * s) * sine) / stiff
        return integral @ np.stack([stretch * cosine, stretch * sine], axis=1)

    def closed(z):
        for _ in range(8):
            gap = places(z)[-1] - [state["nu"], state["rise"]]
            slope = [(places(z + 1e-6 * e) - places(z - 1e-6 * e))[-1] for e in np.eye(n + 2)[n:]]
            z = z - np.concatenate([np.zeros(n), np.linalg.solve(np.array(slope).T / 2e-6, gap)])
        return z

    assert places(z)[-1] == pytest.approx([state["nu"], state["rise"]], abs=1e-12)
    move = np.concatenate([np.random.default_rng(0).normal(size=n), np.zeros(2)])
    h = 1e-5
    rate = (places(closed(z + h * move)) - places(closed(z - h * move))) / (2.0 * h)
    exact = (rod.mesh.weights[:, None] * rate**2).sum()
    mass = rod.inertia(state.z[None], state.p[None])[0]
    assert move[:n] @ mass @ move[:n] == pytest.approx(exact, rel=1e-6)


def test_a_rod_in_space_vibrates_in_the_plane_and_out_of_it():
    """A round cantilever has each frequency twice; a state in the plane has those of the plane."""
    wire = {"torsion": 0.77, "lateral": 1.0}
    cantilever = em.SpatialRod(ends=("clamped", "free"), loads=LOADED, **wire)
    exact = (CANTILEVER[:2] ** 2 / (2.0 * np.pi)).repeat(2)
    found = cantilever.natural_state().natural_frequencies(4)
    np.testing.assert_allclose(found, exact, rtol=1e-6)
    flat = em.lift(em.Rod(load="uniform").natural_state(Theta=1.0), {"q": 1.0}).end.state
    state = em.SpatialRod(load="uniform", **wire).planar_state(flat)
    both, plane = state.natural_frequencies(6), flat.natural_frequencies(2)
    assert np.abs(both[:, None] / plane - 1.0).min(axis=0) == pytest.approx(0.0, abs=1e-6)


def test_states_of_orbits_vibrate_as_those_of_slightly_unequal_stiffness():
    """The turn about the clamps is the only mode less; all others differ by O(1e-4), in 2 %."""
    given = {"torsion": 0.75, "loads": {}, "span": 0.9}
    way = [{"twist_B": 3.0}, {"Theta": 0.0}]

    def twisted(lateral):
        rod = em.SpatialRod(lateral=lateral, **given)
        return em.lift(rod.natural_state(Theta=0.2), way).end.state

    free = twisted(1.0).natural_frequencies(5)
    near = twisted(1.0001).natural_frequencies(6)
    pinned = em.SpatialRod(lateral=1.0, phase=True, **given).natural_state(twist_B=3.0)
    assert near[0] < 0.01 * near[1]
    np.testing.assert_allclose(free, near[1:], rtol=1e-3)
    np.testing.assert_allclose(pinned.natural_frequencies(5), free, rtol=1e-9)


def test_many_frequencies_that_are_nearly_equal_are_told_apart():
    """Ten cantilevers at one clamp, stiffnesses 0.2 % apart. 1e-8: one element of degree 6."""
    joints, members, stiff = {"O": (0.0, 0.0)}, [], []
    for k in range(10):
        joints[f"T{k}"] = (np.cos(0.2 * np.pi * k), np.sin(0.2 * np.pi * k))
        stiff.append(1.0 + 0.002 * ((7 * k) % 10))
        members.append(em.Member(("O", f"T{k}"), EI=stiff[-1], mass=1.0))
    load = {"P": {"T0": (0.0, 1.0)}}
    frame = em.Frame(joints, members, {"O": "fixed"}, load, elements=1, degree=6)
    exact = CANTILEVER[0] ** 2 * np.sqrt(np.sort(stiff))
    for count in (1, 2, 5):
        found = frame.natural_state().natural_frequencies(count)
        np.testing.assert_allclose(found, exact[:count], rtol=1e-8)


def test_stiff_modes_beside_a_soft_one_are_finite():
    """ω₁ is 4000 times below ω₆ where stiffnesses differ by 1e-5; stiff modes hardly change."""
    found = []
    for lateral in (1.001, 1.00001):
        rod = em.SpatialRod(torsion=0.75, lateral=lateral, loads={}, span=0.9)
        way = [{"twist_B": 3.0}, {"Theta": 0.0}]
        state = em.lift(rod.natural_state(Theta=0.2), way).end.state
        found.append(state.natural_frequencies(6))
    assert found[1][0] == pytest.approx(0.1 * found[0][0], rel=1e-2)
    np.testing.assert_allclose(found[1][1:], found[0][1:], rtol=1e-3)


def test_frequencies_of_a_truss_are_those_of_its_joint():
    """Two bars at a joint: ω² = 2 EA cos²/(l m) along, 2 EA sin²/(l m) across; in kN, mm, kg."""
    joints = {"A": (-1000, 0), "B": (0, 100), "C": (1000, 0)}
    bars = [em.Bar(end, EA="20 N", mass="1 kg") for end in (("A", "B"), ("B", "C"))]
    truss = em.Truss(
        joints, bars, {"A": "xy", "C": "xy"}, {"F": {"B": (0, -1)}},
        masses={"B": "2000 g"}, units={"force": "kN", "length": "mm"},
    )  # fmt: skip
    length, mass = np.sqrt(1.01), 3.0
    exact = np.sqrt(2.0 * 20.0 / length**3 / mass * np.array([0.01, 1.0]))
    np.testing.assert_allclose(em.natural_state(truss).natural_frequencies(2), exact, rtol=1e-12)
    assert truss.time_unit == "s"
    again = from_identity(truss.identity())
    np.testing.assert_allclose(em.natural_state(again).natural_frequencies(2), exact, rtol=1e-12)


def test_frequencies_of_a_frame_are_those_of_the_beam_that_it_is():
    """A cantilever and a clamped–pinned beam of two members: β = 3.9266. SI from kN and mm."""
    joints = {"A": (0, 0), "B": (500, 0), "C": (1000, 0)}
    members = [em.Member(ends, EI="2 N m^2", weight="0.6 kg/m") for ends in PAIRS]
    given = {"loads": {"P": {"B": (0, -1)}}, "units": {"force": "kN", "length": "mm"}}
    free = em.Frame(joints, members, {"A": "fixed"}, **given)
    found = em.natural_state(free).natural_frequencies(2)
    np.testing.assert_allclose(found, CANTILEVER[:2] ** 2 * np.sqrt(2.0 / 0.6), rtol=1e-5)
    held = em.Frame(joints, members, {"A": "fixed", "C": "y"}, **given)
    found = em.natural_state(held).natural_frequencies()
    np.testing.assert_allclose(found, 3.9266023120**2 * np.sqrt(2.0 / 0.6), rtol=1e-5)
    plain = [em.Member(ends, EI=2.0, mass=0.3) for ends in PAIRS]
    other = em.Frame(
        {"A": (0, 0), "B": (0.5, 0), "C": (1, 0)}, plain, {"A": "fixed"}, given["loads"]
    )
    found = em.natural_state(other).natural_frequencies()
    np.testing.assert_allclose(found, CANTILEVER[:1] ** 2 * np.sqrt(2.0 / 0.6), rtol=1e-5)


def test_frequencies_of_a_frame_in_space_are_those_about_both_axes():
    """A cantilever of two pieces whose stiffnesses are 2 and 5: ω = β² √(EI/m) each."""
    joints = {"A": (0, 0, 0), "B": (0.5, 0, 0), "C": (1, 0, 0)}
    member = em.SpatialMember(("A", "B", "C"), EI=2.0, EI_out=5.0, mass=0.6)
    frame = em.SpatialFrame(joints, [member], {"A": "fixed"}, {"P": {"C": (0, 0, -1)}}, elements=1)
    for made in (frame, from_identity(frame.identity())):
        found = em.natural_state(made).natural_frequencies(4)
        exact = np.sort(np.outer(CANTILEVER[:2] ** 2, np.sqrt(np.array([2.0, 5.0]) / 0.6)).ravel())
        np.testing.assert_allclose(found, exact, rtol=2e-8)


@pytest.mark.parametrize("axial", [None, 50.0])
def test_a_swaying_portal_vibrates_in_space_as_in_its_plane(axial):
    """Very stiff across its plane; at a loaded state, and where members stretch, too. 1e-6."""
    ends = (("A", "B"), ("B", "C"), ("C", "D"))
    joints = {"A": (0, 0), "B": (0, 1), "C": (1, 1), "D": (1, 0)}
    lifted = {name: (x, 0, y) for name, (x, y) in joints.items()}
    flat = [em.Member(each, EA=axial, mass=1.0) for each in ends]
    stiff = [em.SpatialMember(each, EI_out=1e3, GJ=1e3, EA=axial, mass=1.0) for each in ends]
    supports = dict.fromkeys("AD", "fixed")
    found = []
    for make, places, members, push in (
        (em.Frame, joints, flat, (1, 0)), (em.SpatialFrame, lifted, stiff, (1, 0, 0)),
    ):  # fmt: skip
        frame = make(places, members, supports, {"H": {"B": push}}, elements=1)
        state = em.lift(em.natural_state(frame), {"H": 0.5}).end.state
        found.append(state.natural_frequencies(2))
    np.testing.assert_allclose(found[1], found[0], rtol=1e-6)


def test_portal_with_stretchable_legs_vibrates_as_stiffer_ones_do():
    """Multipliers follow from the turns where members stretch: EA → ∞ is the inextensible limit."""

    def sway(axial):
        ends = (("A", "B"), ("B", "C"), ("C", "D"))
        members = [em.Member(each, EA=axial, mass=1.0) for each in ends]
        joints = {"A": (0, 0), "B": (0, 1), "C": (1, 1), "D": (1, 0)}
        supports = {"A": "fixed", "D": "fixed"}
        frame = em.Frame(joints, members, supports, {"H": {"B": (1, 0)}}, elements=1)
        return em.natural_state(frame).natural_frequencies(2)

    rigid, stiff, stiffer = sway(None), sway(1e4), sway(1e5)
    np.testing.assert_allclose(stiffer, rigid, rtol=3e-4)
    np.testing.assert_allclose((rigid - stiff) / (rigid - stiffer), 10.0, rtol=0.02)


def test_energies_vibrate_with_the_masses_of_their_author():
    """Pendulum ω = √(g/l); double pendulum of equal links ω² = (2 ∓ √2) g/l; spring by hand."""
    gravity = [em.Parameter("M", "", 1.0, "load", 0.0)]
    one = em.EnergyStructure("19.62*0.5*(1 - cos(a)) - M*a", ["a"], gravity, mass=["2*0.5**2"])
    assert em.natural_state(one).natural_frequencies() == pytest.approx(np.sqrt(9.81 / 0.5))
    energy = "-2*cos(a) - cos(b) - M*b"
    rows = [[2.0, "cos(a - b)"], ["cos(a - b)", 1.0]]
    two = em.EnergyStructure(energy, ["a", "b"], gravity, mass=rows)
    exact = np.sqrt(2.0 + np.sqrt(2.0) * np.array([-1.0, 1.0]))
    for made in (two, from_identity(two.identity())):
        np.testing.assert_allclose(em.natural_state(made).natural_frequencies(2), exact, rtol=1e-12)
    spring = em.Spring(mass=2.0)
    slack = spring.natural_state(x_l=1.5)
    assert slack.natural_frequencies() == pytest.approx(np.sqrt(1.5 * 0.5 / (2.0 * 1.5**2)))


@pytest.mark.parametrize(
    ("make", "why"),
    [
        (
            lambda: em.Truss({"A": (0, 0), "B": (1, 0)}, [("A", "B")], {"A": "xy", "B": "y"},
                             {"F": {"B": (1, 0)}}),
            r"must have a mass; this truss has none\. Give its joints or bars some",
        ),
        (
            lambda: em.Frame({"A": (0, 0), "B": (1, 0)}, [("A", "B")], {"A": "fixed"},
                             {"F": {"B": (1, 0)}}),
            r"must have a mass; this frame has none\. Give every member one",
        ),
        (
            lambda: em.EnergyStructure("x**2 - F*x", ["x"], FORCE),
            r"must have a mass; this energy has none\. Give each unknown one",
        ),
    ],
)  # fmt: skip
def test_structures_without_mass_say_how_to_give_it(make, why):
    """One line each."""
    with pytest.raises(InputError, match=why):
        em.natural_state(make()).natural_frequencies()


def test_masses_that_are_no_mass_matrix_are_refused():
    """One line each."""
    with pytest.raises(InputError, match="`mass` must have one formula for each of the 2 unknowns"):
        em.EnergyStructure("x**2 + y**2 - F*x", ["x", "y"], FORCE, mass=["1"])
    joints = {"A": (0, 0), "B": (1, 0), "C": (2, 0)}
    with pytest.raises(InputError, match="`masses` must leave no joint that moves without mass"):
        em.Truss(joints, [("A", "B"), ("B", "C")], {"A": "xy", "B": "y", "C": "y"},
                 {"F": {"B": (1, 0)}}, masses={"B": 1.0})  # fmt: skip


def test_what_cannot_vibrate_is_refused(upright):
    """Unstable states, structures without mass, too many modes: one line each."""
    with pytest.raises(
        InputError, match=r"must have a mass; this rod has none\. Give it one, like"
    ):
        em.Rod(EI=1.0, length=1.0).natural_state(Theta=1.0).natural_frequencies()
    with pytest.raises(InputError, match="`count` must be from 1 to 51"):
        upright.natural_frequencies(52)
    search = em.find_equilibria(upright.structure, upright.parameters, seed=1)
    unstable = search[search.index > 0][0]
    with pytest.raises(InputError, match="`state` must be stable to vibrate"):
        unstable.natural_frequencies()


@pytest.mark.parametrize(
    ("given", "why"),
    [
        ({"mass": 1.0}, "`mass` must come with EI and length"),
        ({"mass": "1 m", "EI": 1.0, "length": 1.0}, "`mass` must be a mass in kg"),
        (
            {
                "mass": 1.0,
                "length": 1.0,
                "section": em.Round("2 mm", E="70 GPa", nu=0.33, density=2700),
            },
            "`mass` must be left out for a rod whose section gives it",
        ),
    ],
)
def test_wrong_masses_are_refused(given, why):
    """One line each."""
    with pytest.raises(InputError, match=why):
        em.Rod(**given)


def test_states_that_turn_for_nothing_vibrate_across_their_orbits_in_frames_in_space():
    """A bent round column between coaxial clamps: frequencies were 4e-7, ∞, ∞.

    Under a load across that vanishes the lowest falls like its root, the others stay, to the load.
    """
    ends = {"A": "fixed", "B": "fixed"}
    member = em.SpatialMember(("A", "B"), EI=1.0, GJ=0.8, EA=1000.0, mass=1.0)
    loads, shorter = {"w": {"A-B": (0, 1, 0)}}, {"m": {"move": {"B": (-1, 0, 0)}}}
    joints = {"A": (0, 0, 0), "B": (1, 0, 0)}
    frame = em.SpatialFrame(joints, [member], ends, loads, shorter, elements=3)
    pushed = em.lift(frame.natural_state(), [{"w": 2.0}, {"m": 0.25}]).end.state
    assert (pushed.natural_frequencies(3) < 50.0).all()
    near, lone = (em.lift(pushed, {"w": w}).end.state for w in (1e-5, 0.0))
    lowest, *others = near.natural_frequencies(3)
    assert lowest < 0.01 * others[0]
    assert lone.natural_frequencies(2) == pytest.approx(others, rel=1e-5)
