"""What an author of an energy may do wrong, and the line that says so."""

import sys

import casadi as ca
import pytest

from equimorph.errors import InputError
from equimorph.model import Parameter
from equimorph.structures import EnergyStructure, Unknown
from typecheck import unchecked

LOAD, STIFFNESS = Parameter("M", "1", 1.0, "load"), Parameter("k", "1", 1.0, "fixed", 1.0)


def made(energy="k*phi**2/2 - M*phi", unknowns="phi", parameters=(LOAD, STIFFNESS), **more):
    return EnergyStructure(energy, unknowns, parameters, **more)


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"energy": "k*phi**2/2 - M*phi)"}, "`energy` must be a formula; got 'k*phi**2"),
        ({"energy": "k*phi**2/2 + 1/(2 - 2)"}, "`energy` must be a formula of finite numbers; got"),
        ({"energy": "k*phi*9**9**9"}, "`energy` must be a formula of finite numbers; got"),
        ({"energy": "k*phi*(-1)**0.5"}, "must be a formula in real numbers, not in '(-1) ** 0.5'"),
        ({"energy": "k*psi"}, "`energy` must be a formula in phi, M, k, not in the unknown symbol"),
        ({"energy": "__import__('os').getcwd()"}, "not in \"__import__('os').getcwd()\"; got"),
        ({"energy": "k*phi.real"}, "not in 'phi.real'; got"),
        ({"energy": "sin(phi, k)"}, "the right number of arguments (sin has 1)"),
        ({"energy": "0 < phi < 1"}, "not in '0 < phi < 1'; got"),
        ({"energy": "k*phi**2 % 2"}, "not in 'k * phi ** 2 % 2'; got"),
        ({"energy": "'phi'"}, "not in \"'phi'\"; got"),
        ({"energy": "+".join(["phi"] * 30000)}, "`energy` must be a"),
        ({"energy": None}, "a number or a casadi.SX expression; got None"),
        ({"energy": ca.SX.sym("x", 2)}, "symbol"),
        ({"energy": ca.SX.sym("x")}, "`energy` must use unknowns and parameters only; got"),
        ({"energy": ca.SX.sym("phi") * ca.SX.sym("phi")}, "one symbol per name; got two of phi"),
        ({"energy": "k*fabs(phi) - M*phi"}, "must be twice differentiable; got fabs. Replace fabs"),
        ({"energy": "if_else(phi < 0, phi, k*phi**2) - M*phi"}, "must be twice differentiable"),
        ({"energy": "k*phi**2"}, "`M` must appear in the energy or a constraint; it does not"),
        ({"unknowns": ["phi", "psi"]}, "`psi` must appear in the energy or a constraint"),
        ({"unknowns": []}, "`unknowns` must name at least one unknown; got none"),
        ({"unknowns": [3]}, "`unknowns` must be names, unknowns"),
        ({"unknowns": ["phi", "phi"]}, "`name` must be given once, and be no function"),
        ({"unknowns": ["sin"]}, "`name` must be given once, and be no function; got sin again"),
        ({"unknowns": ["1phi"]}, "`name` must be a letter, then letters, digits and underscores"),
        ({"unknowns": [{"name": "phi", "colour": 1}]}, "`unknowns` must hold Unknowns (name,"),
        ({"parameters": [LOAD, {"title": "k"}]}, "`parameters` must hold Parameters (name, unit"),
        ({"constraints": ["k - 1"]}, "`constraints[0]` must depend on an unknown; it does not"),
        ({"constraints": ["phi"]}, "`constraints` must be fewer than the 1 unknowns; got 1"),
        ({"unknowns": [Unknown("phi", "phi")]}, "`natural` must depend on parameters only"),
        ({"unknowns": [Unknown("phi", 0.5)]}, "must be an equilibrium with all loads at zero; got"),
        ({"unknowns": [Unknown("phi", "log(0)")]}, "dE/dphi = -inf"),
        ({"unknowns": [Unknown("phi", period=2.0)]}, "`period` of phi must leave all forces unch"),
        ({"draw": [["phi", 0]]}, "`draw` must have at least two points; got one"),
        ({"draw": [["phi"], [0, 0]]}, "points of two formulas [x, y]; got ['phi']"),
        ({"draw": [["x", 0], [0, 0]]}, "`draw[0][0]` must be a formula in phi, M, k"),
        ({"descriptors": {"twice": "2*psi"}}, "`descriptors.twice` must be a formula in phi, M, k"),
        ({"definitions": {"b": "c", "c": "phi"}}, "`definitions.b` must be a formula in phi, M, k"),
    ],
)  # fmt: skip
def test_a_wrong_argument_is_refused_by_name(arguments, text):
    with unchecked(), pytest.raises(InputError) as caught:
        made(**arguments)
    assert text in str(caught.value)
    assert "\n" not in str(caught.value)
    assert len(str(caught.value)) < 500


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        ({"guesses": (1.0, -1.0)}, "`guesses` must be two finite numbers (lower, upper)"),
        ({"guesses": (0.0, float("inf"))}, "`guesses` must be two finite numbers (lower, upper)"),
        ({"lower": 1.0, "upper": 0.0}, "`lower` of phi must be less than `upper`; got 1.0 and 0.0"),
        ({"period": 0.0}, "`period` must be a positive number; got 0.0"),
        ({"period": 2.0, "lower": -1.0}, "`period` of phi must not stand beside `lower`"),
        ({"mass": 0.0}, "`mass` must be positive and finite; got 0.0"),
        ({"mass": float("nan")}, "`mass` must be positive and finite; got nan"),
    ],
)  # fmt: skip
def test_a_wrong_unknown_is_refused(arguments, text):
    with unchecked(), pytest.raises(InputError) as caught:
        Unknown("phi", **arguments)
    assert text in str(caught.value)


@pytest.mark.parametrize("text", ["psi", "effort(psi)", "", "phi + 1"])
def test_an_unknown_descriptor_is_refused(text):
    with pytest.raises(InputError, match="must be"):
        made().descriptor(text)


def test_without_casadi_the_line_says_how_to_install_it(monkeypatch):
    monkeypatch.setitem(sys.modules, "casadi", None)
    with pytest.raises(InputError, match=r"must have the package casadi; got none. Run: pip"):
        made()
