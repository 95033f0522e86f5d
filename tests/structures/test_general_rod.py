"""General rods: the arch as a special case, natural states, symmetries, fields, units."""

import numpy as np
import pytest

import equimorph as em
from equimorph.structures import from_identity


def general_arch(load="uniform", **options):
    """The arch, with an option that leaves everything as it is."""
    return em.Rod(loads={"q": em.LineLoad(load)}, **options)


def states_of(rod, lanes=24):
    """Equilibria under light loads, by Newton from natural states."""
    generator = np.random.default_rng(3)
    spread = generator.uniform(-0.3, 0.3, (lanes, 4))
    p = np.array([1.0, 0.1, 0.4, 0.8]) + spread * [1, 1, 1, 0.3]
    z = rod.natural(p * [1, 1, 0, 1])[0]
    for _ in range(8):
        z = z - rod.solve(z, p, rod.residual(z, p)[:, None]).x[:, 0]
    assert np.abs(rod.residual(z, p)).max() < 1e-13
    return z, p


@pytest.mark.parametrize("load", ["uniform", "left-half"])
def test_the_general_path_equals_the_fast_one_on_the_arch(load):
    """Same quadrature: round-off, 1e-12 of numbers up to 10; fields by other means: 1e-10."""
    fast, general = em.Rod(load), general_arch(load)
    z, p = states_of(fast)
    wide = np.concatenate([p, np.zeros((len(p), 1))], axis=1)
    assert [each.name for each in general.parameters] == ["Theta", "Delta", "q", "nu", "rise"]
    for name in ("energy", "residual"):
        here, there = (getattr(*each) for each in ((fast, name), (general, name)))
        np.testing.assert_allclose(there(z, wide), here(z, p), atol=1e-12)
    np.testing.assert_allclose(general.effort(z, wide)[:, :4], fast.effort(z, p), atol=1e-12)
    generator = np.random.default_rng(1)
    row, dp = generator.normal(size=z.shape), generator.normal(size=p.shape)
    more = np.concatenate([dp, np.zeros((len(p), 1))], axis=1)
    corner, defect = np.ones(len(z)), generator.normal(size=len(z))
    one, two = (
        fast.advance(z, p, dp, row, corner, defect),
        general.advance(z, wide, more, row, corner, defect),
    )
    np.testing.assert_array_equal(one.index, two.index)
    scale = np.abs(one.dz).max(axis=1, keepdims=True)
    np.testing.assert_allclose(two.dz / scale, one.dz / scale, atol=1e-9)
    s = np.linspace(0, 1, 31)
    np.testing.assert_allclose(general.fields(z, wide, s), fast.fields(z, p, s), atol=1e-10)
    largest = fast.largest_curvature(z, p), general.largest_curvature(z, wide)
    np.testing.assert_allclose(largest[1][0], largest[0][0], rtol=1e-10)


def test_natural_states_of_the_general_path_are_those_of_the_arch():
    """Same continuation: 1e-11, the last Newton correction."""
    fast, general = em.Rod(), general_arch()
    generator = np.random.default_rng(0)
    p = generator.uniform([0.1, -1, 0, 0.6], [2.5, 1, 0, 0.95], (40, 4))
    z, found = fast.natural(p)
    again, same = general.natural(np.concatenate([p, np.zeros((40, 1))], axis=1))
    np.testing.assert_array_equal(found, same)
    np.testing.assert_allclose(again[found], z[found], atol=1e-10)


def test_limit_load_of_the_general_path_is_that_of_the_arch():
    """PHYSICS §5; 1e-9 as for the arch."""
    rest = general_arch().natural_state(Theta=0.9)
    limit = em.limit_load(rest, "q")
    assert limit.kind == "branch point"
    assert limit.value == pytest.approx(4.2439977594, rel=1e-9)


@pytest.mark.parametrize(
    ("rod", "names"),
    [
        (general_arch(), ["mirror", "reflection", "half turn"]),
        (general_arch("left-half"), ["reflection"]),
        (em.Rod(ends=("clamped", "free")), ["reflection"]),
        (em.Rod(curvature=1.0), ["mirror"]),
        (em.Rod(ends=("clamped", "pinned"), curvature=1.0), []),
        (em.Rod(stiffness=[[0, 1], [0.5, 2], [1, 1]]), ["mirror", "reflection", "half turn"]),
        (em.Rod(stiffness=[[0, 1], [1, 2]]), ["reflection"]),
    ],
)
def test_symmetries_are_found(rod, names):
    assert [symmetry.name for symmetry in rod.symmetries()] == names


def test_fields_obey_the_differential_equations():
    """B(κ − κ₀)' = shear force: central differences of the fields. 1e-5: step 1e-4 squared, κ''."""
    rod = em.Rod(
        ends=("clamped", "pinned"),
        stiffness=[[0, 1], [1, 3]],
        curvature=[[0, 1], [1, -1]],
        loads={"q": em.LineLoad(direction=(0.5, -1.0))},
    )
    bent = em.lift(rod.natural_state(theta_A=0.5, nu=0.9), {"q": 1.0}).end.state
    s, h = np.linspace(0.05, 0.95, 19), 1e-4

    def moment(at):
        kappa = rod.fields(bent.z[None], bent.p[None], at)[0, :, 1]
        return (1 + 2 * at) * (kappa - 1 + 2 * at) / (4 * np.pi**2)

    rate = (moment(s + h) - moment(s - h)) / (2 * h)
    theta = rod.fields(bent.z[None], bent.p[None], s)[0, :, 0]
    lam, mu = (rod.support_force(name)(bent) for name in ("lambda", "mu"))
    shear = (mu - s) * np.cos(theta) - (lam + 0.5 * s) * np.sin(theta)
    np.testing.assert_allclose(rate, shear, atol=1e-6)
    assert moment(np.array([1.0]))[0] == pytest.approx(0.0, abs=1e-9)
    x, y = rod.position(1.0)
    assert (x(bent), y(bent)) == pytest.approx((0.9, 0.0), abs=1e-9)


def test_a_tendon_bends_like_the_couples_at_its_anchors():
    """T d at one anchor, −T d at the other: the same moments. Round-off."""
    loads = {"M": [em.Couple(0.25), em.Couple(0.75)]}
    with pytest.raises(em.InputError, match="must have a different name"):
        em.Rod(ends=("clamped", "free"), loads={"nu": em.Couple(0.5)})
    arm = em.Rod(ends=("clamped", "free"), actuators={"T": em.Tendon(0.1, 0.25, 0.75)})
    bent = arm.natural_state(T=2.0)
    kappa = arm.fields(bent.z[None], bent.p[None], np.array([0.1, 0.5, 0.9]))[0, :, 1]
    np.testing.assert_allclose(kappa, [0, 0.2 * 4 * np.pi**2, 0], atol=1e-11)
    couples = em.Rod(ends=("clamped", "free"), loads=loads)
    assert arm.natural_state(T=0.0).energy == couples.natural_state().energy == 0.0


def test_a_curvature_segment_bends_into_an_arc():
    """Free soft arm: κ = 2 on the middle third only. Round-off."""
    arm = em.Rod(ends=("clamped", "free"), actuators={"k": em.Curvature(2.0, 1 / 3, 2 / 3)})
    bent = arm.natural_state(k=1.0)
    s = np.array([0.2, 0.4, 0.6, 0.9])
    theta = arm.fields(bent.z[None], bent.p[None], s)[0, :, 0]
    np.testing.assert_allclose(theta, [0, 2 * (0.4 - 1 / 3), 2 * (0.6 - 1 / 3), 2 / 3], atol=1e-12)
    assert bent.energy == pytest.approx(0.0, abs=1e-14)


def test_named_coordinates_are_the_linear_combinations_they_say():
    """turn = θ_A = −θ_B: the arch's Θ under another name, Δ = 0."""
    free = {"Theta": 1.0, "nu": 0.9, "q": 0.0}
    arch = em.Rod().natural_state(**free)
    turned = em.Rod(coordinates={"turn": {"theta_A": 1.0, "theta_B": -1.0}})
    state = turned.natural_state(turn=1.0, nu=0.9)
    np.testing.assert_allclose(state.z, arch.z, atol=1e-10)
    each = em.Rod(coordinates={}).natural_state(theta_A=1.0, theta_B=-1.0, nu=0.9)
    np.testing.assert_allclose(each.z, arch.z, atol=1e-10)


def test_a_stiff_spring_is_a_held_end_and_a_soft_one_a_free_end():
    """First order in the compliance: 1e-6 relative to 4π²B/L³ and 4π²B/L."""

    def tip(end):
        rod = em.Rod(ends=("clamped", end), loads={"P": em.PointForce(0.5)})
        return rod.height(0.5)(em.lift(rod.natural_state(), {"P": 0.3}).end.state)

    soft, stiff = 1e-7, 1e7
    sprung = em.End(angle=stiff, x="free", y=stiff), em.End(angle=soft, x="free", y=soft)
    assert tip(sprung[0]) == pytest.approx(tip("sliding"), rel=1e-5)
    assert tip(sprung[1]) == pytest.approx(tip("free"), rel=1e-5)


def test_the_inextensible_rod_is_the_limit_of_the_extensible_one():
    """Error ∝ 1/EA: halves when EA doubles."""

    def height(axial):
        rod = em.Rod(ends=("clamped", "free"), loads={"P": em.PointForce(1.0)}, axial=axial)
        return rod.height(1.0)(em.lift(rod.natural_state(), {"P": 0.2}).end.state)

    exact = height(None)
    errors = [abs(height(axial) - exact) for axial in (1e3, 2e3, 1e6)]
    assert errors[0] / errors[1] == pytest.approx(2.0, rel=1e-2)
    assert errors[2] < 1e-6


def test_a_bar_pulled_along_its_axis_stretches_by_hooke():
    """Closed form: x(1) = 1 + F/EA. Round-off."""
    bar = em.Rod(ends=("clamped", "free"), loads={"F": em.PointForce(1.0, (1, 0))}, axial=2.0)
    state = em.lift(bar.natural_state(), {"F": 0.1}).end.state
    assert bar.position(1.0)[0](state) == pytest.approx(1.05, rel=1e-12)
    assert state.energy == pytest.approx(-(0.1**2) / 4 - 0.1, rel=1e-12)


def test_dimensional_and_non_dimensional_rods_agree():
    """Every result in its unit: round-off."""
    EI, L = 0.02, 0.4
    force, couple = 4 * np.pi**2 * EI / L**2, 4 * np.pi**2 * EI / L
    both = [
        em.Rod(
            ends=("clamped", em.End(angle="free", y=40.0 * (1 if si else L / force))),
            curvature=0.5 if not si else 0.5 / L,
            actuators={"T": em.Tendon(0.05 * (L if si else 1))},
            loads={"q": em.LineLoad(), "M": em.Couple(1.0)},
            span=0.9 * (L if si else 1),
            **({"EI": EI, "length": L} if si else {}),
        )
        for si in (False, True)
    ]
    plain = em.lift(both[0].natural_state(T=0.3), {"q": 0.2, "M": 0.05}).end.state
    values = {"q": 0.2 * force / L, "M": 0.05 * couple}
    soft = {"ends": ("clamped", "free"), "loads": {"F": em.PointForce(1.0, (1, 0))}}
    bar = em.Rod(axial=50.0, EI=EI, length=L, **soft).natural_state()
    assert em.lift(bar, {"F": 5.0}).end.state.shape()[-1, 0] == pytest.approx(1.1 * L, rel=1e-12)
    si = em.lift(both[1].natural_state(T=0.3 * force), values).end.state
    np.testing.assert_allclose(si.z, plain.z, atol=1e-10)
    units = {
        "height(0.3)": (L, "m"),
        "curvature(0.3)": (1 / L, "1/m"),
        "max_curvature": (1 / L, "1/m"),
        "energy": (couple, "J"),
        "support_force(mu)": (force, "N"),
        "end_moment(0)": (couple, "N m"),
    }
    for text, (unit, label) in units.items():
        here, there = (rod.descriptor(text) for rod in both)
        assert there(si) == pytest.approx(here(plain) * unit, rel=1e-9)
        assert there.unit == label
    assert si.energy == pytest.approx(plain.energy * couple, rel=1e-9)
    np.testing.assert_allclose(si.shape(), plain.shape() * L, atol=1e-10)
    assert [each.unit for each in both[1].parameters] == ["rad", "N", "N/m", "N m", "m", "m"]


@pytest.mark.parametrize(
    "rod",
    [
        em.Rod(ends=("clamped", "free"), EI=2.0, length=3.0),
        em.Rod(
            ends=("pinned", em.End(angle=0.1, x=2.0)),
            stiffness=[[0, 1], [1, 2]],
            curvature=1.0,
            axial=10.0,
            loads={"q": [em.LineLoad("left-half", (1, 0)), em.LineLoad()], "M": em.Couple(0.3)},
            actuators={"k": em.Curvature([[0, 0], [1, 1]], 0.2, 0.5)},
            coordinates={"turn": {"theta_B": 2.0}},
            span=0.8,
            rise=0.1,
        ),
    ],
    ids=["units", "everything"],
)
def test_a_general_rod_is_rebuilt_from_its_identity(rod):
    again = from_identity(rod.identity())
    assert again.parameters == rod.parameters
    p = np.array([[parameter.default for parameter in rod.parameters]]) + 0.1
    z = rod.sample(p, np.random.default_rng(0))
    np.testing.assert_array_equal(again.residual(z, p), rod.residual(z, p))
    assert again.identity() == rod.identity()


def test_errors_are_estimated_for_general_rods():
    """The estimate bounds the change to a much finer rod."""

    def bent(degree):
        rod = em.Rod(
            ends=("clamped", "free"), loads={"P": em.PointForce(0.5)}, elements=3, degree=degree
        )
        return rod, em.lift(rod.natural_state(), {"P": 2.0}).end.state

    (rod, state), (fine, exact) = bent(4), bent(12)
    error = abs(rod.max_curvature(state) - fine.max_curvature(exact))
    assert error <= state.error_estimate < 1e3 * error + 1e-12


def test_a_rod_under_pressure_agrees_in_both_unit_systems():
    """p in N/m of a strip: force over length. Round-off."""
    EI, L = 0.02, 0.4
    force = 4 * np.pi**2 * EI / L**2
    options = {"ends": ("clamped", "pinned"), "loads": {"p": em.Pressure()}}
    plain = em.Rod(curvature=-2.0, span=0.82, **options)
    si = em.Rod(curvature=-2.0 / L, span=0.82 * L, EI=EI, length=L, **options)
    here = em.lift(plain.natural_state(theta_A=1.1), {"p": -0.5}).end.state
    there = em.lift(si.natural_state(theta_A=1.1), {"p": -0.5 * force / L}).end.state
    np.testing.assert_allclose(there.z, here.z, atol=1e-10)
    assert si.support_force("mu")(there) == pytest.approx(
        plain.support_force("mu")(here) * force, rel=1e-10
    )
