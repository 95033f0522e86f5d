"""Sets end where energies say nothing: at collapsed bars, and at dependent constraints."""

import numpy as np
import pytest

import equimorph as em
from equimorph.errors import EndlessError
from equimorph.manifold.complex.description import beyond_bounds
from equimorph.manifold.geometry.points import VertexKind
from oracles import specimens
from oracles.complexes import assert_faithful
from oracles.specimens import portal, toggle
from typecheck import unchecked


def slide(strain="engineering") -> em.Truss:
    """Bars A-P and P-B in one line; P moves along it by u, and A-P has the rest length 1 + a."""
    return em.Truss(
        {"A": (0.0, 0.0), "P": (1.0, 0.0), "B": (3.0, 0.0)},
        [("A", "P"), ("P", "B")],
        {"A": "xy", "P": "y", "B": "xy"},
        {"F": {"P": (1.0, 0.0)}},
        {"a": {"A-P": 1.0}},
        strain,
    )


def test_a_sheet_ends_where_its_bar_collapses():
    """u = F/1.5 up to 1 + u = 0.01, and beyond A the other sheet, u = (F − 2)/1.5."""
    eset = em.equilibrium_set(slide(), em.Box(F=(-2.0, 0.4)), fixed={"a": 0.0}, intervals=(20,))
    assert eset.audit.clean, eset.audit
    assert (eset.audit.components, dict(eset.audit.loops)) == (2, {"box": 3, "cap": 1})
    u, load = eset.points.z[:, 0], eset.points["F"]
    here = u > -1.0
    np.testing.assert_allclose(u, np.where(here, load, load - 2.0) / 1.5, atol=1e-9)
    assert u[here].min() == pytest.approx(-0.99, abs=1e-9)


def test_bars_collapse_along_a_curve():
    """Over a and F the sheet (u − a)/(1 + a) + u/2 = F ends at 1 + u = (1 + a)/100."""
    eset = em.equilibrium_set(slide(), em.Box(a=(-0.3, 0.4), F=(-2.0, 0.1)), intervals=(5, 9))
    assert eset.audit.clean, eset.audit
    assert_faithful(eset)
    ends = np.flatnonzero(eset.kinds == VertexKind.CAP)
    u, a = eset.points.z[ends, 0], eset.points["a"][ends]
    assert len(ends) > 5
    np.testing.assert_allclose(np.abs(1.0 + u), (1.0 + a) / 100, atol=1e-9)


def test_green_strain_has_no_kink():
    """(1 + u)((1 + u)² − 1)/2 + … = F is one cubic: its sheet passes u = −1 without an end."""
    truss = slide("green")
    assert truss.validity == ()
    eset = em.equilibrium_set(truss, em.Box(F=(-1.0, 0.4)), fixed={"a": 0.0}, intervals=(20,))
    assert eset.audit.clean, eset.audit
    assert set(dict(eset.audit.loops)) == {"box"}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("box", "grid"),
    [
        (em.Box(a=(-0.2547, 0.2844), F=(-0.2957, -0.1195)), (9, 13)),
        (em.Box(a=(0.1614, 0.2316), F=(-0.1236, 0.0103)), (14, 11)),
        (em.Box(a=(-0.2768, 0.2048), F=(-0.272, 0.0037)), (14, 12)),
        (em.Box(a=(-0.2908, -0.2168), F=(-0.1763, 0.1678)), (4, 10)),
    ],
)
def test_tripods_whose_legs_collapse_are_clean(box, grid):
    """Joint D comes to its foot A at (1, 0, 0): 55 rays there could not be traced.

    The end of the sheet of index 3 has a tip at a = −0.2671, F = 0: its load vanishes, and the
    collapsing leg turns around. There a straight cell turned over in the last two boxes.
    """
    with unchecked():
        eset = em.equilibrium_set(specimens.tripod(), box, intervals=grid, checks=1)
    assert eset.audit.clean, eset.audit


def two_links() -> em.EnergyStructure:
    """Two links between supports a span apart, φ₁ = −φ₂ = ±acos(span), and a spring aside."""
    return em.EnergyStructure(
        "(a1 - a2)**2/2 - w*sin(a1) + b**2/2",
        [
            em.Unknown("a1", "acos(span)", (-1.5, 1.5)),
            em.Unknown("a2", "-acos(span)", (-1.5, 1.5)),
            em.Unknown("b", "0"),
        ],
        [
            em.Parameter("span", "1", 1.0, "actuator", 0.8, 0.0, 1.0),
            em.Parameter("w", "1", 1.0, "load"),
        ],
        constraints=["(cos(a1) + cos(a2))/2 - span", "(sin(a1) + sin(a2))/2"],
    )


def test_a_sheet_ends_where_constraints_become_dependent():
    """Stretched out, the forces of the constraints grow like 1/sin φ; all sheets end before.

    There are two, ±acos(span), and any number of their copies whole turns away, which are refused.
    """
    links = two_links()
    independence = links.descriptor("constraint_independence")
    given = {"box": em.Box(span=(0.6, 0.99999)), "fixed": {"w": 0.1}, "intervals": (9,)}
    largest = em.Descriptor("largest", "1", lambda z, p: np.abs(z[:, :2]).max(axis=1))
    with pytest.raises(EndlessError, match="whole turns"):
        em.equilibrium_set(links, **given)
    with unchecked():
        eset = em.equilibrium_set(links, **given, within=[largest <= 3.0])
    assert eset.audit.clean, eset.audit
    assert eset.audit.components == 2
    assert dict(eset.audit.loops) == {"box": 2, "cap": 2}
    angle, span = eset.points.z[:, 0], eset.points["span"]
    np.testing.assert_allclose(np.cos(angle), span, atol=1e-9)
    # gradients are (−s, s)/2 and (c, c)/2: singular values s/√2 and c/√2
    sine = np.abs(np.sin(angle))
    share = (independence(eset.points) / sine)[sine < 0.5]
    np.testing.assert_allclose(share, share[0], rtol=1e-6)
    ends = eset.kinds == VertexKind.CAP
    np.testing.assert_allclose(independence(eset.points)[ends], 0.02, rtol=1e-6)


@pytest.mark.slow
def test_chains_with_a_reversed_link_end_where_they_lie_in_one_line():
    """Four links one way and one the other: at span 3/5, whatever the load; 2280 rays were lost."""
    chain = specimens.closed_chain()
    largest = em.Descriptor("largest", "1", lambda z, p: np.abs(z[:, :5]).max(axis=1))
    with unchecked():
        eset = em.equilibrium_set(
            chain,
            em.Box(span=(0.57, 0.64)),
            fixed={"a": 0.6823, "w": 0.5},
            within=[largest <= 3.6],
            intervals=(6,),
            checks=0,
        )
    assert eset.audit.clean, eset.audit
    turned = np.abs(eset.points.z[:, :5]).max(axis=1)
    ends = (eset.kinds == VertexKind.CAP) & (turned < 3.59)
    assert ends.sum() > 10
    np.testing.assert_allclose(eset.points["span"][ends], 0.6, atol=0.01)
    lined_up = np.abs(np.sin(eset.points.z[ends, :5])).max(axis=1)
    assert lined_up.max() < 0.1


@pytest.mark.parametrize("space", [False, True])
def test_a_rod_that_is_pressed_ends_where_it_has_no_length(space):
    """EA = 0.5 < 4: the straight rod never buckles and shortens by P/EA, to 0.99 at P = 0.495."""
    shared = {"axial": 0.5, "loads": {"P": em.PointForce(1.0, (-1.0, 0.0))}, "elements": 2}
    rod = em.Rod(ends=("clamped", "sliding"), **shared)
    if space:
        slider = em.SpatialEnd(x="free")
        rod = em.SpatialRod(torsion=0.8, lateral=2.0, ends=("clamped", slider), **shared)
    pressed = em.lift(rod.natural_state(), {"P": 0.3}).end.state
    assert rod.max_shortening(pressed) == pytest.approx(0.6, rel=1e-12)
    assert rod.max_shortening == rod.descriptor("max_shortening")
    within = [rod.max_curvature <= 1.0]
    eset = em.equilibrium_set(rod, em.Box(P=(0.0, 0.6)), within=within, intervals=(4,), checks=0)
    assert eset.coordinates.max() == pytest.approx(0.495, rel=1e-9)


def column(space: bool) -> em.Frame | em.SpatialFrame:
    """A member of length 2, EI = 1 and EA = 5 between a clamp and a head that moves along it."""
    if space:
        return em.SpatialFrame(
            {"A": (0.0, 0.0, 0.0), "B": (0.0, 0.0, 2.0)},
            [em.SpatialMember(("A", "B"), EI=1.0, EI_out=2.0, GJ=0.8, EA=5.0, normal=(1, 0, 0))],
            {"A": "fixed", "B": {"x": "held", "y": "held", "rotation": "held"}},
            {"P": {"B": (0.0, 0.0, -1.0)}},
        )
    return em.Frame(
        {"A": (0.0, 0.0), "B": (0.0, 2.0)},
        [em.Member(("A", "B"), EI=1.0, EA=5.0)],
        {"A": "fixed", "B": {"x": "held", "angle": "held"}},
        {"P": {"B": (0.0, -1.0)}},
    )


@pytest.mark.parametrize("space", [False, True])
def test_a_member_that_is_pressed_ends_where_it_has_no_length(space):
    """P (1 − P/EA) ≤ EA/4 < π²/4: the column never buckles and shortens by P/EA, to 0.99."""
    frame = column(space)
    pressed = em.lift(frame.natural_state(), {"P": 3.0}).end.state
    assert frame.max_shortening(pressed) == pytest.approx(0.6, rel=1e-12)
    assert frame.max_shortening == frame.descriptor("max_shortening")
    within = [frame.max_curvature <= 1.0]
    eset = em.equilibrium_set(frame, em.Box(P=(0.0, 6.0)), within=within, intervals=(4,), checks=0)
    assert eset.coordinates.max() == pytest.approx(4.95, rel=1e-9)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("a", "load", "bound", "intervals"),
    [
        ((-0.8381, 0.6701), (-1.8168, 1.6665), 11.97, (7, 6)),
        ((-0.6045, 0.6457), (-0.9097, -0.1394), 13.08, (6, 4)),
    ],
)
def test_members_with_several_bends_end_where_the_sharpest_has_the_bound(a, load, bound, intervals):
    """Peaks of like heights in one element: vertices were up to .17 beyond the bound, or below."""
    frame = toggle(2, 10)
    box, within = em.Box(a=a, P=load), [frame.max_curvature <= bound]
    eset = em.equilibrium_set(frame, box, within=within, intervals=intervals)
    at_bound = eset.points[eset.kinds == VertexKind.CAP]
    assert eset.audit.clean
    assert frame.max_curvature(eset.points).max() <= bound * (1.0 + 1e-9)
    np.testing.assert_allclose(frame.max_curvature(at_bound), bound, rtol=1e-9)


def test_cells_with_a_vertex_beyond_a_bound_are_wrong():
    """Of a set that does not know the bound; sets that know it have none."""
    spring, box = em.Spring(), em.Box(x_l=(0.6, 1.4), F=(-0.4, 0.4))
    free, bound = em.equilibrium_set(spring, box, intervals=(6, 6)), spring.angle <= 0.2
    held = em.equilibrium_set(spring, box, within=[bound], intervals=(6, 6))
    beyond = (spring.angle(free.points) > 0.2)[free.cells].any(axis=1)
    assert 0 < beyond.sum() < len(beyond)
    np.testing.assert_array_equal(beyond_bounds(free.points, free.cells, (bound,)), beyond)
    assert not beyond_bounds(held.points, held.cells, (bound,)).any()


@pytest.mark.slow
def test_cells_turned_over_beside_a_bound_are_divided_where_sheets_cross_elsewhere():
    """A thin cell between the side of the box and the bound, which bends; crossings lie apart."""
    frame = portal(50.0).resolving(2.19)
    eset = em.equilibrium_set(
        frame, em.Box(k=(-0.6318, 0.3583), d=(-0.1905, -0.1605)), fixed={"P": 0.0, "q": 0.6662},
        within=[frame.max_curvature <= 2.19], intervals=(13, 15),
    )  # fmt: skip
    assert len(eset.crossings)
    assert eset.audit.clean, eset.audit


@pytest.mark.slow
def test_cells_turned_over_where_two_crossing_curves_meet_are_divided():
    """Near (k, P) = (0.06, 2.0) cells have corners on both curves; folds are near pitchforks."""
    frame = portal(50.0, 2, 8).resolving(4.65)
    eset = em.equilibrium_set(
        frame, em.Box(k=(-0.9012, 0.7189), P=(-4.639, 3.5699)), fixed={"d": 0.1821, "q": 0.0},
        within=[frame.max_curvature <= 4.65], intervals=(11, 17),
    )  # fmt: skip
    assert eset.audit.clean, eset.audit
