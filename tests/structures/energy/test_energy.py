"""Energies as formulas: against the written-out spring, against CasADi's values, and as data."""

import re

import casadi as ca
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

import equimorph as em
from equimorph.errors import InputError
from equimorph.model import Parameter
from equimorph.structures import EnergyStructure, Spring, Unknown, from_identity
from equimorph.structures.energy.expressions import FUNCTIONS, expression, write_formulas
from equimorph.structures.energy.tape import tape
from oracles.specimens import closed_chain, written_spring
from typecheck import unchecked

DRAWN = settings(max_examples=10, deadline=None, derandomize=True, database=None)


@given(seed=st.integers(0, 2**32 - 1))
@DRAWN
def test_the_spring_by_its_energy_is_the_spring(seed):
    """All of the contract's quantities. 1e-12: round-off where x_l/cos δ is as large as 30."""
    plain, formula = Spring(1.3), written_spring()
    generator = np.random.default_rng(seed)
    p = generator.uniform([0.4, -0.5, 0.5], [1.5, 0.5, 2.0], (21, 3))
    z, dz, dp = plain.sample(p, generator), *(generator.normal(size=(21, n)) for n in (1, 3))

    def quantities(structure):
        along = (dz, dp)
        return [
            structure.energy(z, p),
            structure.residual(z, p),
            structure.effort(z, p),
            structure.parameter_derivative(z, p, dp),
            structure.second_derivative(z, p, along, along),
            structure.solve(z, p, np.ones((21, 1, 1))).x,
            structure.index(z, p),
            structure.natural(p * [1, 0, 1])[0],
            structure.shape(z, p),
        ]

    for expected, found in zip(quantities(plain), quantities(formula), strict=True):
        np.testing.assert_allclose(found, expected, rtol=1e-11, atol=1e-11)
    assert [each.name for each in formula.parameters] == [each.name for each in plain.parameters]
    np.testing.assert_array_equal(formula.resolved(4 * z, p), plain.resolved(4 * z, p))


ARGUMENTS = {"acosh": (1.7,), "atan2": (0.3, -0.8), "hypot": (0.3, -0.8), "fmin": (0.3, -0.8)}
ARGUMENTS |= {"fmax": (0.3, -0.8), "if_else": (0.0, 0.3, -0.8)}


@pytest.mark.parametrize("name", FUNCTIONS)
def test_every_function_runs_as_in_casadi(name):
    """Values and slopes at nine lanes. 1e-14: sines are our own, to one unit in the last place."""
    given_at = ARGUMENTS.get(name, (0.6,))
    symbols = [ca.SX.sym(f"x{i}") for i in range(len(given_at))]
    names = {symbol.name(): symbol for symbol in symbols}
    graph = expression(f"{name}({', '.join(names)})", names, "formula")
    column = ca.vertcat(graph, ca.gradient(graph, ca.vertcat(*symbols)))
    x = np.array(given_at) * np.linspace(1.0, 1.3, 9)[:, None]
    exact = ca.Function("exact", [ca.vertcat(*symbols)], [column])
    expected = np.array(exact(x.T)).T
    found = tape([ca.vertcat(*symbols)], column)(x)
    np.testing.assert_allclose(found, expected, rtol=1e-14, atol=1e-15)


def test_functions_outside_their_domain_are_no_numbers():
    x = ca.SX.sym("x")
    column = ca.vertcat(ca.asin(x), ca.acos(x), ca.atanh(x), ca.acosh(-x), ca.log(-x), ca.sqrt(-x))
    assert np.isnan(tape([x], column)(np.array([[2.0]]))).all()


def test_formulas_are_written_and_read_back_bit_for_bit():
    """Every operation and constant, through text."""
    x, y = ca.SX.sym("x"), ca.SX.sym("part")
    graph = ca.vertcat(
        ca.sin(x) ** 2 / (1 + ca.exp(-y)) - 1 / 3 * ca.sqrt(x * x + 0.1),
        ca.if_else(x < y, x**3.5, -y) + ca.fmin(x, y) * 2 + ca.atan2(y, x) - x**-2,
    )
    definitions, texts = write_formulas(graph.elements(), [x, y])
    names = {"x": x, "part": y}
    for name, text in definitions.items():
        names[name] = expression(text, names, name)
    again = ca.vertcat(*(expression(text, names, "again") for text in texts))
    at = np.random.default_rng(1).uniform(0.1, 2.0, (9, 2))
    both = ca.vertcat(x, y)
    np.testing.assert_array_equal(tape([both], again)(at), tape([both], graph)(at))


def test_graphs_and_texts_make_the_same_structure():
    """A structure from casadi.SX, one from text, and the first rebuilt from its identity."""
    phi, k, moment = ca.SX.sym("phi"), ca.SX.sym("k"), ca.SX.sym("M")
    parameters = [Parameter("M", "N·m", 1.0, "load"), Parameter("k", "N·m", 1.0, "fixed", 2.0)]
    graph = EnergyStructure(
        k * (1 - ca.cos(phi)) - moment * phi, phi, parameters, draw=[[0, 0], [ca.sin(phi), 1]]
    )
    text = EnergyStructure(
        "k*(1 - cos(phi)) - M*phi", "phi", parameters, draw=[[0, 0], ["sin(phi)", 1]]
    )
    z, p = np.array([[0.4]]), np.array([[0.3, 2.0]])
    for other in (text, from_identity(graph.identity())):
        np.testing.assert_array_equal(other.residual(z, p), graph.residual(z, p))
        np.testing.assert_array_equal(other.shape(z, p), graph.shape(z, p))


def test_unknowns_are_descriptors_and_so_are_named_formulas_and_efforts():
    spring = written_spring()
    state = spring.natural_state(x_l=0.8)
    angle = np.arccos(0.8)
    assert spring.descriptor("delta")(state) == pytest.approx(angle, rel=1e-14)
    assert spring.descriptor("height")(state) == pytest.approx(0.8 * np.tan(angle), rel=1e-14)
    assert spring.descriptor("effort(F)")(state) == pytest.approx(0.8 * np.tan(angle), rel=1e-14)
    assert spring.descriptor("energy")(state) == 0.0
    assert spring.descriptor("delta") == written_spring().descriptor("delta")
    assert spring.elevation.name == "height"
    assert closed_chain().elevation.name == "phi0"


def test_a_shape_is_a_line_through_its_points():
    spring = written_spring()
    z, p = np.array([[0.5]]), np.array([[0.8, 0.0, 1.0]])
    halfway = spring.shape(z, p, np.array([0.0, 0.5, 1.0]))[0, 1]
    np.testing.assert_allclose(halfway, [0.4, 0.4 * np.tan(0.5)], rtol=1e-15)
    angles = np.arange(5.0)
    state = np.concatenate([angles, [0.0, 0.0]])[None]
    outline = closed_chain().shape(state, np.array([[0.8, 0.3, 0.0]]))
    np.testing.assert_array_equal(outline[0], np.stack([angles, angles], axis=1))


def test_rounded_natural_values_are_corrected():
    """cos φ = 0.8 has a natural angle of 0.6435; 0.65 is near enough. 1e-15: one Newton step."""
    parameters = [Parameter("M", "1", 1.0, "load"), Parameter("c", "1", 1.0, "actuator", 0.8)]
    made = EnergyStructure("(cos(phi) - c)**2/2 - M*phi", [Unknown("phi", 0.65)], parameters)
    assert made.natural_state().z[0] == pytest.approx(np.arccos(0.8), rel=1e-15)
    assert made.natural_state(c=0.3).z[0] == pytest.approx(np.arccos(0.3), rel=1e-14)


def test_a_natural_state_that_is_lost_on_the_way_is_refused():
    """x² = c has no solution for c < 0; the continuation from c = 1 ends at the fold."""
    parameters = [Parameter("M", "1", 1.0, "load"), Parameter("c", "1", 1.0, "actuator", 1.0)]
    made = EnergyStructure("x**3/3 - c*x - M*x", [Unknown("x", 1.0)], parameters)
    with pytest.raises(em.InputError, match=r"must have a natural state; none is found at c=-1"):
        made.natural_state(c=-1.0)
    with pytest.raises(em.InputError, match="`M` must be 0 in the natural state; got 1"):
        made.natural_state(M=1.0)


def test_points_that_no_unknown_moves_are_pins_and_others_as_their_author_says():
    """A foot that is clamped, a tip under a force, a point that the parameter a alone moves."""
    made = EnergyStructure(
        "phi**2/2 - M*phi + a*phi**3",
        ["phi"],
        [
            Parameter("a", "1", 1.0, "actuator", 0.5),
            Parameter("M", "1", 1.0, "load"),
        ],
        draw=[[0, 0], ["cos(phi)", "sin(phi)"], ["a", 1]],
        supports=[{"point": 0, "kind": "clamp", "angle": 0.5}],
        forces=[{"point": 1, "force": ["-M*sin(phi)", "M*cos(phi)"]}],
    )
    z, p = np.array([[0.3], [0.4]]), np.array([[0.5, 2.0], [0.6, 0.0]])
    for structure in (made, from_identity(made.identity())):
        drawing = structure.drawing(z, p)
        clamp, pin = drawing.supports
        assert (clamp.kind, pin.kind) == ("clamp", "pin")
        np.testing.assert_allclose(clamp.directions, [[np.cos(0.5), np.sin(0.5)]] * 2)
        np.testing.assert_allclose(pin.places, [[0.5, 1.0], [0.6, 1.0]])
        (push,) = drawing.forces
        np.testing.assert_allclose(push.places[0, 0], [np.cos(0.3), np.sin(0.3)])
        tip = [-2.0 * np.sin(0.3), 2.0 * np.cos(0.3)]
        np.testing.assert_allclose(push.vectors[:, 0], [tip, [0.0, 0.0]], atol=1e-15)


@pytest.mark.parametrize(
    ("given", "text"),
    [
        ({"supports": [{"point": 2}]}, "`supports[0].point` must be the number of a point"),
        ({"supports": [{"point": 0, "kind": "rope"}]}, "`supports[0].kind` must be one of clamp"),
        ({"supports": [{"point": 0, "angle": np.inf}]}, "`supports[0].angle` must be a finite"),
        ({"supports": [{"at": 0}]}, "`supports` must be a list of tables of point, kind and angle"),
        ({"forces": [{"point": 0, "force": "M"}]}, "`forces[0].force` must be two formulas"),
        ({"forces": [{"point": 0, "force": ["M", "x"]}]}, "forces[0].force[1]"),
    ],
)
def test_wrong_supports_and_forces_are_refused(given, text):
    with unchecked(), pytest.raises(InputError, match=re.escape(text)):
        EnergyStructure(
            "phi**2/2 - M*phi",
            ["phi"],
            [Parameter("M", "1", 1.0, "load")],
            draw=[[0, 0], ["cos(phi)", "sin(phi)"]],
            **given,
        )
