"""What a caller can do wrong with sets, and what the answer is."""

import re

import pytest

from equimorph.errors import InputError
from equimorph.manifold import equilibrium_set, level_set, locate, restricted, singular_set
from equimorph.model import Box
from equimorph.structures import Rod, Spring
from typecheck import unchecked


@pytest.mark.parametrize(
    ("box", "options", "message"),
    [
        (
            Box(F=(-1, 1), x_l=(0.5, 1), k=(1, 2), m=(0, 1)),
            {},
            "`box` must have one, two or three parameters; got 4 (F, x_l, k, m).",
        ),
        (
            Box(F=(-1, 1), Theta=(0, 1)),
            {},
            "`Theta` must be a parameter (x_l, F, k); got 'Theta'.",
        ),
        (
            Box(F=(-1, 1), x_l=(0.5, 1)),
            {"fixed": {"x_l": 1.0}},
            "`fixed` must not name a parameter of the box; got x_l.",
        ),
        (
            Box(F=(-1, 1), x_l=(0.5, 1)),
            {"fixed": {"q": 1.0}},
            "`q` must be a parameter (x_l, F, k); got 'q'.",
        ),
        (
            Box(F=(-1, 1), x_l=(0.5, 1)),
            {"fixed": {"k": -1.0}},
            "`k` must be a finite number greater than 0; got -1.0.",
        ),
        (
            Box(F=(-1, 1), x_l=(-0.5, 1)),
            {},
            "`x_l` must be a finite number greater than 0; got -0.5.",
        ),
        (
            Box(F=(-1, 1), x_l=(0.5, 1)),
            {"intervals": (1, 5)},
            "`intervals` must be a list of whole numbers >= 2; got 1.",
        ),
        (
            Box(F=(-1, 1)),
            {"intervals": (4, 5)},
            "`intervals` must be one whole number >= 2; got (4, 5).",
        ),
        (
            Box(F=(-1, 1)),
            {"intervals": 4.5},
            "`intervals` must be a list of whole numbers >= 2; got 4.5.",
        ),
        (
            {"F": (-1, 1)},
            {},
            "`box` must be a box, like `Box(q=(0.0, 2.5))`; got {'F': (-1, 1)}.",
        ),
        (
            Box(F=(-1, 1)),
            {"fixed": 0.5},
            '`fixed` must be finite numbers by name, like `{"q": 2.5}`; got 0.5.',
        ),
        (
            Box(F=(-1, 1)),
            {"checks": -1},
            "`checks` must be a whole number from 0 to 100000; got -1.",
        ),
        (Box(F=(-1, 1)), {"seed": 0.5}, "`seed` must be a whole number >= 0; got 0.5."),
        (
            Box(F=(-1, 1)),
            {"accuracy": "fine"},
            "`accuracy` must be positive and finite; got 'fine'.",
        ),
    ],
)
def test_wrong_problem_is_refused_by_name(box, options, message):
    with unchecked(), pytest.raises(InputError, match=f"^{re.escape(message)}$"):
        equilibrium_set(Spring(), box, **options)


@pytest.mark.parametrize(
    ("ask", "message"),
    [
        (
            lambda e: e.at(x_l="wide", F=0.1),
            "`x_l` must be a finite number greater than 0; got 'wide'.",
        ),
        (lambda e: e.at(x_l=0.8, F=None), "`F` must be a finite number; got None."),
        (
            lambda e: e.at(x_l=[0.8, 0.9], F=[0.1, 0.1]),
            "`x_l` must be a finite number greater than 0; got [0.8, 0.9]. Use `over` for many ",
        ),
        (
            lambda e: e.over(x_l=["wide"], F=[0.1]),
            "`x_l` must be a finite number greater than 0; got ['wide'].",
        ),
        (
            lambda e: locate(e, [0.1, 0.2]),
            "`measured` must be finite numbers by descriptor, like `{rod.max_curvature: 6.0}` or "
            "an array of finite numbers (points, dims); got [0.1, 0.2].",
        ),
        (
            lambda e: level_set(e, "angle", 0.1),
            "`descriptor` must be a descriptor, like `rod.max_curvature`; got 'angle'.",
        ),
        (
            lambda e: singular_set(e, ["angle", "length"]),
            "`descriptors` must be a list of descriptors, like `[rod.max_curvature]`; got 'angle'.",
        ),
        (
            lambda e: restricted(e, Spring().angle),
            "`constraint` must be a constraint, like `rod.max_curvature <= 6`; got ",
        ),
    ],
)
def test_what_sets_are_asked_in_other_terms_is_refused(spring_set, ask, message):
    with unchecked(), pytest.raises(InputError, match=f"^{re.escape(message)}"):
        ask(spring_set)


def test_what_is_no_structure_is_refused():
    said = "^`structure` must be a structure, like `Rod\\(\\)`; got 'arch'\\.$"
    with unchecked(), pytest.raises(InputError, match=said):
        equilibrium_set("arch", Box(F=(-1, 1)))


@pytest.mark.parametrize("within", ["angle <= 1", ["angle <= 1"], [Spring().angle], 3.0])
def test_what_is_no_constraint_is_refused(within):
    said = r"^`within` must be a list of constraints, like `\[rod.max_curvature <= 6\]`; got "
    for each in (within, Spring().angle <= 1):
        with unchecked(), pytest.raises(InputError, match=said):
            equilibrium_set(Spring(), Box(F=(-1, 1)), within=each)


def test_reversed_bounds_are_refused_by_name():
    with pytest.raises(
        InputError,
        match=r"^`F` must be two finite numbers \(lower, upper\), lower < upper; got \(1, -1\)\.$",
    ):
        Box(F=(1, -1), x_l=(0.5, 1))


def test_parameter_without_a_default_must_be_fixed():
    """Δ and the load of a rod have one, Θ has none."""
    with pytest.raises(InputError, match="`Theta` must be given; got no value"):
        equilibrium_set(Rod(), Box(Delta=(0.5, 1), q=(0, 1)))


@pytest.mark.parametrize(
    ("at", "message"),
    [
        ({"x_l": 0.8}, "`at` must give x_l and F; got x_l."),
        ({}, "`at` must give x_l and F; got nothing."),
        ({"x_l": 0.8, "Theta": 1.0}, "`at` must give x_l and F; got x_l, Theta."),
        (
            {"x_l": 0.8, "F": 0.6},
            "`at` must lie in Box(x_l=(0.3, 1.3), F=(-0.5, 0.5)); got {'x_l': 0.8, 'F': 0.6}.",
        ),
    ],
)
def test_wrong_point_is_refused(spring_set, at, message):
    with pytest.raises(InputError, match=f"^{re.escape(message)}$"):
        spring_set.at(**at)
