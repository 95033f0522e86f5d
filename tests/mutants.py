"""Study files with something wrong in them, or nothing: by structure, and by byte."""

import datetime
import json
import math
import tomllib
from typing import Any

from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy

from studies import ARCH, SPRING, coarse_examples

STUDIES = [SPRING, ARCH, *coarse_examples()]

HUGE = "<a number of 4401 digits>"
"""Stands for a number that Python refuses to print."""
NUMBERS: list[Any] = [
    HUGE,
    *(0, 1, -1, 2, 3, 7, 0.0, -0.0, 0.5, 1.0, -1.0, 1e-9, 5e-324, 1e308, -1e308),
    *(math.nan, math.inf, -math.inf, 2**31, 2**63, -(2**63) - 1, 10**18, 10**400),
]
TEXTS = [
    *("", " ", "rod", "spring", "uniform", "left-half", "stable", "parameter", "x" * 300, "../x"),
    *("angle", "energy", "max_curvature", "height(0.5)", "height(1/0)", "height(nan)", "x(1e400)"),
    *("curvature(1/3)", "angle(-0)", "end_moment(2)", "support_force(nu)", "height(", "height()"),
    *("angle <= 1", "angle<=1e999", "angle >= nan", "energy >= -1e308", "max_curvature <= 0"),
    *("height(1/3) >= 0.1", "<=", "angle <= <= 1", "angle <= 1e", "angle <= --1", "a >= ..", "{x}"),
    *("\x1b[2J", "\n", "\u2028", "\u202e", "é", "🙂", "'", '"', "\\", "\x7f", "\x9b31m"),
]
FORMULAS = [
    *("phi1", "phi2**2", "P*top", "alpha", "top", "1", "x", "phi1/phi2", "sqrt(phi1)", "abs(phi1)"),
    *(
        "9**9**9**9",
        "phi1**1e9",
        "1/0",
        "(-1)**0.5",
        "log(-1)",
        "exp(1e308)",
        "phi1 +",
        "(" * 300,
        "-" * 5000,
    ),
    *("+".join(["phi1"] * 3000), "phi1 if P else 0", "__import__('os')", "phi1.real", "phi1(2)"),
    *("lambda: 0", "[phi1]", "phi1 == 1", "phi1, 2", "cos", "cos()", "cos(1, 2)", "'a'", "1j"),
]
KEYS = [
    *("structure", "set", "equilibria", "route", "title", "kind", "load", "span", "elements"),
    *(
        "energy",
        "unknowns",
        "parameters",
        "definitions",
        "draw",
        "joints",
        "bars",
        "supports",
        "EA",
    ),
    *("degree", "stiffness", "box", "fixed", "within", "intervals", "at", "name", "start", "goal"),
    *("via", "margin", "highest", "lowest", "near", "Theta", "Delta", "q", "nu", "x_l", "F", "k"),
]
DATES = [datetime.date(2020, 1, 1), datetime.time(1, 2, 3), datetime.datetime(2020, 1, 1, 1, 2, 3)]

SCALARS: SearchStrategy[Any] = st.one_of(
    st.sampled_from(NUMBERS),
    st.sampled_from(TEXTS),
    st.sampled_from(FORMULAS),
    st.booleans(),
    st.sampled_from(DATES),
    st.integers(),
    st.floats(),
    st.text(st.characters(exclude_categories=["Cs"]), max_size=20),
)
NAMES = st.one_of(st.sampled_from(KEYS), st.sampled_from(TEXTS), st.text("abc_-. \n", max_size=5))
VALUES = st.recursive(
    SCALARS,
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(NAMES, inner, max_size=4)),
    max_leaves=8,
)


def written(value: Any) -> str:
    """Value as TOML, tables in line."""
    if isinstance(value, dict):
        pairs = (f"{json.dumps(key)} = {written(each)}" for key, each in value.items())
        return "{" + ", ".join(pairs) + "}"
    if isinstance(value, list):
        return "[" + ", ".join(map(written, value)) + "]"
    if value == HUGE:
        return "1" + "0" * 4400
    if isinstance(value, bool | str):
        return json.dumps(value).replace("\x7f", "\\u007f")
    if isinstance(value, int):
        return str(value)
    return repr(value) if isinstance(value, float) else value.isoformat()


def document(study: dict[str, Any]) -> str:
    """Study as a TOML file."""
    return "".join(f"{json.dumps(key)} = {written(value)}\n" for key, value in study.items())


def _places(value: Any, path: tuple[Any, ...] = ()) -> list[tuple[Any, ...]]:
    """Paths of all entries of tables and lists."""
    if not isinstance(value, dict | list):
        return []
    found = []
    for key, each in value.items() if isinstance(value, dict) else enumerate(value):
        found += [(*path, key), *_places(each, (*path, key))]
    return found


@st.composite
def mutated_structures(draw: DrawFn) -> bytes:
    """A study in which a few entries are removed, renamed, repeated, added or replaced."""
    study = tomllib.loads(draw(st.sampled_from(STUDIES)))
    for _ in range(draw(st.integers(1, 3))):
        places = _places(study)
        if not places:
            break
        *path, last = draw(st.sampled_from(places))
        home: Any = study
        for key in path:
            home = home[key]
        way = draw(st.sampled_from(["replace", "replace", "scale", "remove", "rename", "repeat"]))
        _change(draw, home, last, way)
    return document(study).encode("utf-8", "surrogatepass")


def _change(draw: DrawFn, home: Any, last: Any, way: str) -> None:
    value = home[last]
    if way == "replace":
        home[last] = draw(VALUES)
    elif way == "scale" and type(value) in (int, float):
        home[last] = value * draw(st.sampled_from([-1, 0, 2, 0.5, 1e-3, 1e3]))
    elif way == "remove":
        del home[last]
    elif isinstance(home, dict):
        home[draw(NAMES)] = value if way == "repeat" else home.pop(last)
    else:
        home.append(value)


PLAUSIBLE = [
    *("angle", "height", "energy", "height(0.5)", "max_curvature", "curvature(0)", "x(1/3)"),
    *("angle <= 1.2", "height >= -2", "energy <= 3", "max_curvature <= 8", "height(0.5) >= -0.1"),
    *("uniform", "left-half", "rod", "spring", "other-name", "phi1", "phi2**2", "P*top", "cos(P)"),
    *("lean", "a.y", "a", "b", "xy", "x"),
]


@st.composite
def plausible_mutants(draw: DrawFn) -> bytes:
    """A study that may well be meant: other numbers, other names, fewer or more entries."""
    study = tomllib.loads(draw(st.sampled_from(STUDIES)))
    for _ in range(draw(st.integers(1, 3))):
        places = [path for path in _places(study) if "intervals" not in path]
        *path, last = draw(st.sampled_from(places))
        home: Any = study
        for key in path:
            home = home[key]
        value = home[last]
        if type(value) in (int, float):
            factor = st.sampled_from([-1.0, 0.0, 0.5, 0.9, 0.99, 1.01, 1.1, 1.5, 2.0])
            home[last] = value * draw(factor) + draw(st.sampled_from([0.0, 0.0, 0.1, -0.1]))
        elif isinstance(value, str):
            home[last] = draw(st.sampled_from(PLAUSIBLE))
        elif isinstance(home, dict):
            del home[last]
        else:
            home.append(value)
    return document(study).encode()


@st.composite
def mutated_bytes(draw: DrawFn) -> bytes:
    """A study file that was cut, or in which a few stretches of bytes are lost or replaced."""
    content = draw(st.sampled_from(STUDIES)).encode()
    for _ in range(draw(st.integers(1, 3))):
        start = draw(st.integers(0, len(content)))
        stop = draw(st.one_of(st.just(len(content)), st.integers(start, start + 8)))
        some = st.one_of(st.binary(max_size=4), st.sampled_from([b"", b"\xff", b"=", b"[", b'"']))
        content = content[:start] + draw(some) + content[stop:]
    return content


MUTANTS = st.one_of(mutated_structures(), plausible_mutants(), mutated_bytes())
