"""Cells that are hard to decide: thin wedges behind cusps, tongues along constraints."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from equimorph.array_types import Float
from equimorph.manifold import build, equilibrium_set
from equimorph.manifold.lifting import cells
from equimorph.manifold.lifting.cells import areas_over
from equimorph.model import Box, Parameter
from equimorph.structures import EnergyStructure, Rod, Unknown
from equimorph.study.prepare import prepare
from equimorph.study.problem import parse_study
from oracles.complexes import assert_faithful
from oracles.rods import inflated_rod
from sets import arch_set
from typecheck import unchecked

Places = Float[np.ndarray, "places 2"]
EXAMPLES = Path(__file__).parents[2] / "examples"
FAST = {(2.5, 20.0)}
CASES = [
    pytest.param(q, cap, marks=[] if (q, cap) in FAST else [pytest.mark.slow])
    for q in (0.0, 1.0, 2.5, 4.0, 6.0, 9.0, 12.0)
    for cap in (10.0, 20.0, 40.0, 80.0)
]


@pytest.mark.parametrize(("q", "cap"), CASES)
def test_left_half_load_runs_clean(q, cap):
    """Loads from 0, where the rod is symmetric, to 12; caps of max |κ| from 10 to 80.

    Six elements do not resolve all states with max |κ| above 20: what is left out is named.
    """
    eset = arch_set(load="left-half", q=q, cap=cap, checks=1)
    assert replace(eset.audit, left_out=0).clean, eset.audit
    assert cap > 20.0 or eset.audit.clean
    assert eset.crossings == ()


@pytest.mark.parametrize(
    ("load", "intervals"),
    [
        ("left-half", (31, 33)),
        pytest.param("uniform", (31, 33), marks=pytest.mark.slow),
        pytest.param("left-half", (51, 19), marks=pytest.mark.slow),
    ],
)
def test_points_that_close_cells_along_a_constraint_are_of_their_sheet(load, intervals):
    """Both ends on one side of a grid triangle, and a fold inside that its edges do not show.

    Near (0.80, 0) points on the constraint amid two of index 13 have index 14, far outside: cells
    that they close hide the fold.
    """
    eset = arch_set(intervals, load=load, cap=40.0)
    assert eset.audit.bisected > 0
    assert eset.audit.clean, eset.audit
    assert_faithful(eset)


def test_discs_that_a_bisection_leaves_are_found_only_once(monkeypatch):
    """Doubtful triangles are divided several times; to find everything anew gives the same set."""
    question = {"intervals": (31, 33), "load": "left-half", "cap": 40.0}
    at_once = arch_set(**question)
    assert at_once.audit.bisected > 0
    monkeypatch.setattr(cells, "areas_over", lambda pairing, _: areas_over(pairing, None))
    anew = arch_set(**question)
    assert at_once.audit == anew.audit
    one, other = (eset.coordinates[np.lexsort(eset.coordinates.T)] for eset in (at_once, anew))
    np.testing.assert_allclose(one, other, rtol=0, atol=1e-12)


@pytest.mark.slow
def test_a_tongue_that_leaves_its_cell_between_vertices_is_lifted_to_its_tip():
    """Tongues of indices 7 to 14 around Δ = 0, which end one after the other from Θ = 0.8357 on.

    No grid vertex lies in them from Θ = 0.8305 on. That of index 9 ends at Θ = 0.8476, where its
    fold is exact (`fold_curve` turns there).
    """
    eset = arch_set((51, 19), cap=40.0)
    assert eset.audit.clean, eset.audit
    assert eset.audit.unresolved > 0
    most = [
        int(eset.at(Theta=theta, Delta=0.0).index.max())
        for theta in (0.825, 0.832, 0.84, 0.846, 0.849)
    ]
    assert most == [14, 14, 10, 10, 8]


def _tongue(generator: np.random.Generator) -> tuple[EnergyStructure, float, Places]:
    """Sheets x² = w² s − t² around the axis of a tongue, s from its tip, and x = 3; its axis.

    E' = (x − 3)(x² − w² s + t²): two states below 3 where t² < w² s, none elsewhere.
    """
    width = 10.0 ** generator.uniform(-1.7, -0.5)
    tip, angle = generator.uniform(-0.7, 0.7, 2), generator.uniform(0.0, 2.0 * np.pi)
    c, s = np.cos(angle), np.sin(angle)
    along = f"({tip @ (c, s):.17g} - ({c:.17g})*p - ({s:.17g})*r)"
    across = f"(({c:.17g})*r - ({s:.17g})*p - ({tip @ (-s, c):.17g}))"
    g = f"({width**2:.17g}*{along} - {across}**2)"
    energy = f"x**4/4 - x**3 - {g}*x**2/2 + 3*{g}*x"
    parameters = [
        Parameter("p", "1", 1.0, "actuator", 0.0),
        Parameter("r", "1", 1.0, "load", 0.0),
    ]
    structure = EnergyStructure(energy, [Unknown("x", "3", guesses=(-2.5, 3.5))], parameters)
    way = np.array([0.003, 0.01, 0.03, 0.1, 0.2, 0.4, 0.8])
    axis = tip - way[:, None] * np.array([c, s])
    return structure, width, axis[np.abs(axis).max(axis=1) < 1.0]


@pytest.mark.parametrize(
    "seeds",
    [(2, 37), pytest.param((*range(2), *range(3, 37), *range(38, 50)), marks=pytest.mark.slow)],
    ids=["few", "many"],
)
def test_tongues_narrower_than_cells_are_lifted_whole(seeds):
    """Random tongues, closed forms, at places from 0.003 of the box beside the tip on.

    There folds bulge out of their chords by half of their length: bands of queries hold that.
    """
    for seed in seeds:
        generator = np.random.default_rng([5, seed])
        structure, width, axis = _tongue(generator)
        intervals = tuple(int(count) for count in generator.integers(6, 20, 2))
        with unchecked():
            eset = equilibrium_set(structure, Box(p=(-1, 1), r=(-1, 1)), intervals=intervals)
        assert eset.audit.clean, (seed, width, eset.audit)
        assert [len(eset.at(p=p, r=r)) for p, r in axis] == [3] * len(axis), (seed, width)


@pytest.mark.slow
@pytest.mark.parametrize("seed", [0, 1, 2])
def test_tongues_that_join_others_only_beyond_the_box_are_met(seed):
    """Arch, κ ≤ 40, over the same box with 12 elements: indices 13 and 14 over a tenth of it.

    Random states hardly lead to them: of four seeds only one found them, under a clean audit. The
    numbers of states over single points are those of thorough searches.
    """
    rod = Rod(load="uniform", elements=12)
    within = [rod.max_curvature <= 40]
    box = Box(Theta=(0.78, 0.92), Delta=(-0.08, 0.08))
    with unchecked():
        eset = equilibrium_set(
            rod, box, fixed={"q": 2.5}, within=within, intervals=(28, 16), seed=seed
        )
    assert eset.audit.clean
    assert eset.audit.on_lines > 100
    known = {(0.782, 0.02): 29, (0.8, 0.01): 29, (0.82, 0.005): 29, (0.82, 0.03): 19}
    for (theta, delta), count in known.items():
        assert len(eset.at(Theta=theta, Delta=delta)) == count


@pytest.mark.parametrize("intervals", [(2, 4), (3, 5)])
def test_sheets_of_waves_that_lie_over_a_corner_of_the_box_are_met_at_once(intervals, monkeypatch):
    """Lines lead from each of them to the next one only, and one check meets them all.

    The ends of the rod are 0.9856 of its length apart in the corner, 0.89 in the next one.
    """
    monkeypatch.setattr(build, "SEARCHES", 2)
    rod, _, _ = inflated_rod(elements=8, degree=9)
    with unchecked():
        eset = equilibrium_set(
            rod,
            Box(nu=(0.8, 0.8774), rise=(-0.2, 0.4489)),
            fixed={"theta_A": 0.4738, "p": 1.0164, "q": 0.1842},
            within=[rod.max_curvature <= 11.0],
            intervals=intervals,
        )
        over = eset.at(nu=0.8774, rise=0.4489)
    assert eset.audit.clean
    # two of each index from one on, but for those at which waves begin and end
    counts = np.bincount([each.index for each in over])
    assert (counts[3:-1] == 2).all()
    assert len(over) == 23


def test_what_the_discretisation_does_not_resolve_is_told_to_be_left_out():
    """Arch, κ ≤ 40, over a small box: states of index 7 and more are not resolved by 6 elements.

    They hang together with resolved ones only outside the box. With 10 elements those with
    κ < 29 are resolved, and found. Up to κ = 20, where all is resolved, nothing is left out.
    """
    box, grid = Box(Theta=(0.78, 0.92), Delta=(-0.08, 0.08)), (14, 8)
    audits, most = [], []
    for elements, cap in ((6, 40), (10, 40), (6, 20)):
        rod = Rod(load="uniform", elements=elements)
        within = [rod.max_curvature <= cap]
        with unchecked():
            eset = equilibrium_set(
                rod, box, fixed={"q": 2.5}, within=within, intervals=grid, checks=1
            )
        audits.append(eset.audit)
        most.append(int(eset.at(Theta=0.82, Delta=0.0).index.max()))
    assert most == [6, 12, 6]
    assert audits[0].faults == {"left_out": audits[0].left_out}
    assert not audits[0].clean
    assert "left out" in dict(audits[0].rows())["not resolved"]
    assert audits[2].left_out == audits[2].unresolved == 0
    assert "not resolved" not in dict(audits[2].rows())


@pytest.mark.parametrize(
    ("name", "box", "grid"),
    [
        ("beam", Box(nu=(0.97, 1.0), P=(-38.0, 42.0)), (41, 41)),
        ("beam", Box(nu=(0.97, 1.0), P=(-38.0, 42.0)), (33, 37)),
        pytest.param("arm", Box(k1=(-1.5, 1.6), P=(1.0, 4.0)), (25, 25), marks=pytest.mark.slow),
        pytest.param("arm", Box(k1=(-1.5, 1.6), P=(1.0, 4.0)), (33, 29), marks=pytest.mark.slow),
    ],
)
def test_wedges_behind_the_cusps_of_the_gallery_are_decided(name, box, grid):
    """Parameters of different sizes: in ν and P the wedge is hundreds of times longer than wide."""
    file = EXAMPLES / f"{name}.toml"
    rod = prepare(parse_study(file.read_text(encoding="utf-8"), file.name)).structure
    fixed = {"theta_A": 1.5707963267948966} if name == "arm" else {"theta_A": 0.0, "theta_B": 0.0}
    cap = 10 if name == "arm" else 12
    with unchecked():
        eset = equilibrium_set(
            rod,
            box,
            fixed=fixed,
            within=[rod.max_curvature <= cap],
            intervals=grid,
            checks=0,
        )
    assert_faithful(eset)
    assert len(eset.folds) == 1
