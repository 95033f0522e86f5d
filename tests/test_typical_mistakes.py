"""Typical mistakes in Python and in studies: each is answered in one line that says what to do."""

import re
from collections.abc import Callable

import pytest

import equimorph as em
from equimorph.errors import InputError
from equimorph.study import parse_study, prepare
from studies import ARCH, SPRING
from typecheck import unchecked

STEEL = em.Strip("20 mm", "0.5 mm", E="210 GPa", nu=0.3)


def arch() -> em.Rod:
    return em.Rod(load="uniform")


def rest() -> em.State:
    return arch().natural_state(Theta=0.9)


# What is written, and what the line must say.
PYTHON: dict[str, tuple[Callable[[], object], str]] = {
    "a length without units": (lambda: em.Rod(span="320 mm"), r"`units` must be given.*Add units="),
    "a number among texts with units": (
        lambda: em.Rod(section=STEEL, length="400 mm", span=320),
        r"`span` must have a unit, as width = '20 mm'",
    ),
    "a span that the rod cannot reach": (
        lambda: em.Rod(section=STEEL, length="300 mm", span="320 mm"),
        r"`span` must be less than the length of the rod, 300 mm; got '320 mm'",
    ),
    "a rise that the rod cannot reach": (
        lambda: em.Rod(section=STEEL, length="300 mm", span="280 mm", rise="200 mm"),
        r"`span`, `rise` must place end B nearer to A than .* 300 mm; got '280 mm', '200 mm'",
    ),
    "a coordinate beyond what it stands for": (
        lambda: em.Rod(coordinates={"gap": {"nu": 2.0}}).natural_state(gap=0.6),
        r"`gap` must be a finite number between -0.5 and 0.5 L",
    ),
    "millimetres for shares of the length": (
        lambda: em.Rod(span=320),
        r"`span` must lie between 0 and 1.*the rod has length 1",
    ),
    "a force for a length": (
        lambda: em.Rod(section=STEEL, length="400 mm", span="2 N"),
        r"`span` must be in units of length",
    ),
    "a text for the value of a parameter": (
        lambda: em.Rod(section=STEEL, length="400 mm", span="320 mm").natural_state(
            Theta=0.3, nu="310 mm"
        ),
        r"`nu` must be a finite number.*got '310 mm'. Write a number in units of m",
    ),
    "a misspelt parameter": (
        lambda: arch().natural_state(theta=0.9),
        r"`theta` must be a parameter \(Theta, Delta.*Did you mean Theta\?",
    ),
    "a misspelt argument": (
        lambda: em.Rod(lods={"F": em.PointForce(0.5)}),  # type: ignore[call-arg]
        r"`Rod` must have arguments among load, .*; got lods. Did you mean loads\?",
    ),
    "a misspelt load": (lambda: em.Rod(load="unifrom"), r"`load` must be.*uniform"),
    "a misspelt end": (lambda: em.Rod(ends=("clampd", "free")), r"clamped"),
    "a misspelt descriptor": (
        lambda: arch().descriptor("max_curvatur"),
        r"Did you mean max_curvature\?",
    ),
    "a share of the length beyond the rod": (lambda: arch().height(2.0), r"`s` must be"),
    "a load that is none": (lambda: em.limit_load(rest(), "Q"), r"`Q`.*Did you mean q\?"),
    "a descriptor for a constraint": (
        lambda: em.limit_load(rest(), "q", within=[arch().max_curvature]),
        r"`within` must be a list of constraints, like `\[rod\.max_curvature <= 6\]`",
    ),
    "one constraint without a list": (
        lambda: em.limit_load(rest(), "q", within=arch().max_curvature <= 10),
        r"`within` must be a list",
    ),
    "a descriptor of another structure": (
        lambda: em.Spring().angle(rest()),
        r"`angle` must be a descriptor of the structure of the state, a rod; got one of a spring",
    ),
    "a box the wrong way round": (lambda: em.Box(Theta=(2.5, 0.2)), r"`Theta`.*lower < upper"),
    "a box of a single number": (lambda: em.Box(Theta=2.5), r"`Theta`"),
    "a name that the box frees and that is fixed, too": (
        lambda: em.equilibrium_set(
            em.Spring(), em.Box(x_l=(0.5, 1.3)), fixed={"x_l": 0.8, "F": 0.0}
        ),
        r"x_l",
    ),
    "values that do not make a grid": (
        lambda: em.Grid.of_values(Theta=[0.0, 1.0, 3.0]),
        r"`Theta` must be two or more values that increase in equal steps",
    ),
    "a joint that is none": (
        lambda: em.Truss({"A": (0.0, 0.0), "B": (1.0, 0.0)}, [("A", "C")], {"A": "xy"}),
        r"C",
    ),
    "a truss without supports": (
        lambda: em.Truss(
            {"A": (0.0, 0.0), "B": (1.0, 0.0)}, [("A", "B")], {}, loads={"F": {"B": (0.0, -1.0)}}
        ),
        r"support",
    ),
    "a negative stiffness": (lambda: em.Bar(("A", "B"), EA=-1.0), r"`EA` must be"),
    "a formula with an unknown symbol": (
        lambda: em.EnergyStructure("k*phi**2", ["phi"], []),
        r"k",
    ),
}


@pytest.mark.parametrize("case", PYTHON)
def test_a_mistake_in_python_is_answered_in_one_line(case: str):
    call, part = PYTHON[case]
    with unchecked(), pytest.raises(InputError) as found:
        call()
    line = str(found.value)
    assert "\n" not in line
    assert re.search(part, line), line
    assert re.search(r"must|needs|has no", line), line


# The study, what is changed in it, and what the line must say.
STUDIES: dict[str, tuple[str, str, str, str]] = {
    "a misspelt key": (ARCH, "intervals", "intervalls", r"Did you mean intervals\?"),
    "a misspelt table": (ARCH, "[[route]]", "[[routes]]", r"`routes`.*Did you mean route\?"),
    "a single bracket": (ARCH, "[[route]]", "[route]", r"Write \[\[route\]\] above each"),
    "degrees": (ARCH, "[0.2, 2.5]", "[10, 80]", r"radians.*If these are degrees, write 1\.396"),
    "a number in quotes": (ARCH, "q = 2.5", 'q = "2.5"', r"Write numbers without quotes"),
    "a decimal comma": (ARCH, "q = 2.5", "q = 2,5", r"must be valid TOML"),
    "text without quotes": (ARCH, '"uniform"', "uniform", r"Text stands in quotes"),
    "Python's True": (ARCH, 'load = "uniform"', "load = True", r"true and false no capitals"),
    "a misspelt descriptor": (ARCH, "max_curvature <= 20", "max_curvatur <= 20", r"Did you mean"),
    "a strict comparison": (ARCH, "max_curvature <= 20", "max_curvature < 20", r"read like"),
    "a constraint without a list": (
        ARCH, '["max_curvature <= 20"]\nintervals', '"max_curvature <= 20"\nintervals', r"in \[ \]",
    ),
    "no bound on an endless set": (
        ARCH, 'within = ["max_curvature <= 20"]\nintervals', "intervals", r'Add "max',
    ),
    "a start beyond the box": (
        ARCH, "start = { at = { Theta = 1.0", "start = { at = { Theta = 9.0", r"must lie in the",
    ),
    "a way-point that names no parameter": (ARCH, "via = [{ Theta", "via = [{ theta", r"Theta"),
    "intervals for one of two parameters": (ARCH, "[5, 9]", "[5]", r"one number of intervals for"),
    "a negative margin": (ARCH, "margin = 0.1", "margin = -0.1", r"margin` must be at least 0"),
    "a parameter that is none": (SPRING, "x_l = [0.5, 1.3]", "xl = [0.5, 1.3]", r"mean x_l\?"),
    "a length without units": (
        ARCH, 'load = "uniform"', 'span = "320 mm"', r"`structure`.*`units` must be given",
    ),
}  # fmt: skip


@pytest.mark.parametrize("case", STUDIES)
def test_a_mistake_in_a_study_is_answered_in_one_line(case: str):
    study, old, new, part = STUDIES[case]
    assert old in study
    with pytest.raises(InputError) as found:
        prepare(parse_study(study.replace(old, new, 1), "mine.toml"))
    line = str(found.value)
    assert "\n" not in line
    assert re.search(part, line), line


def test_there_are_forty():
    assert len(PYTHON) + len(STUDIES) >= 40
