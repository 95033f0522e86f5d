"""What notebooks show of results: tables with numbers and units, all texts escaped."""

import re
from html import unescape

import numpy as np
import pytest

import equimorph as em
from equimorph.tables import html_table
from equimorph.tasks.route import refusal


def _rows(table: str) -> list[list[str]]:
    """Texts of the cells, row by row, as they are read."""
    rows = re.findall(r"<tr>(.*?)</tr>", table)
    return [[unescape(x) for x in re.findall(r"<t[dh][^>]*>(.*?)</t[dh]>", row)] for row in rows]


@pytest.fixture(scope="module")
def eset() -> em.EquilibriumSet:
    spring = em.Spring()
    box = em.Box(x_l=(0.5, 1.3), F=(-0.2, 0.2))
    return em.equilibrium_set(spring, box, within=[spring.angle <= 1.4], intervals=(8, 8))


def test_texts_are_escaped():
    table = html_table("<script>", ["a & b"], [["<b>", 1.0 / 3.0]])
    assert "<script>" not in table
    assert _rows(table) == [["a & b"], ["<b>", "0.333333"]]


def test_a_structure_shows_its_parameters_with_units():
    rows = _rows(em.Rod(load="uniform")._repr_html_())
    assert rows[0] == ["parameter", "role", "default", "unit"]
    assert ["Theta", "actuator", "none", "rad"] in rows
    assert ["q", "load", "0", "4π²B/L²"] in rows


def test_a_state_shows_values_index_and_energy():
    """The arc κ = −2Θ at Θ = 0.9 has energy Θ²/(2π²), PHYSICS section 3, and is stable."""
    state = em.Rod(load="uniform").natural_state(Theta=0.9)
    table = state._repr_html_()
    assert "State of a rod, stable" in table
    rows = {name: value for name, value, _ in _rows(table)[1:]}
    assert rows["Theta"] == "0.9"
    assert rows["index"] == "0"
    assert float(rows["energy"]) == pytest.approx(float(state.energy), rel=1e-5)


def test_states_show_what_differs_and_at_most_twenty(eset):
    states = eset.at(x_l=0.8, F=0.0)
    rows = _rows(states._repr_html_())
    unit = eset.structure.descriptor("energy").unit
    assert rows[0] == ["", "index", "margin", f"energy ({unit})"]
    assert len(rows) == 1 + len(states)
    many = eset.points
    rows = _rows(many._repr_html_())
    named = [f"{each.name} ({each.unit})" for each in eset.structure.parameters[:2]]
    assert rows[0][1:3] == named
    assert len(many) > 20
    assert len(rows) == 21
    assert f"States(spring: {len(many)}), the first 20" in many._repr_html_()


def test_a_set_shows_its_box_and_audit(eset):
    table = eset._repr_html_()
    rows = dict(_rows(table))
    assert rows["x_l"].startswith("0.5 to 1.3")
    assert rows["equilibria (vertices)"] == str(len(eset.points))
    assert rows["audit"] == repr(eset.audit)
    assert repr(eset.audit).startswith("Audit(clean; ")
    audit = dict(_rows(eset.audit._repr_html_()))
    assert audit["cells"] == str(eset.audit.cells)


def test_a_route_shows_its_length_or_why_there_is_none(eset):
    here = eset.at(x_l=0.8, F=0.0).stable
    route = em.plan(eset, here[0], here[1])
    rows = dict(_rows(route._repr_html_()))
    assert float(rows["length"]) == pytest.approx(route.length, rel=1e-5)
    refused = refusal("a < b & c")
    assert _rows(refused._repr_html_()) == [["reason", "a < b & c"]]


def test_a_reduction_shows_its_barriers(eset):
    reduction = em.reduce(eset, prefer=em.charts.lowest(eset.structure.descriptor("angle")))
    rows = dict(_rows(reduction._repr_html_()))
    assert rows["barriers"] == str(len(reduction.barriers))
    assert rows["over"] == "x_l, F"


def test_a_map_shows_its_values_with_the_unit_of_the_load():
    arch = em.Rod(load="uniform")
    grid = em.Grid(Theta=(0.8, 1.0, 2), Delta=(0.1, 0.3, 2))
    found = em.limit_load_map(arch, grid, "q")
    rows = dict(_rows(found._repr_html_()))
    assert rows["Theta"] == "0.8 to 1 rad"
    assert rows["load"] == "q (4π²B/L²)"
    known = found.value[np.isfinite(found.value)]
    assert rows["values"] == f"{known.min():.6g} to {known.max():.6g}"
