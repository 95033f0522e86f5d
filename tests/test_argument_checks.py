"""One wrong argument in otherwise right calls of all public functions: each is refused in a line.

The faults follow from the annotations: wrong types, not a number, complex and infinite numbers,
texts for numbers, absurd counts, and states, sets and descriptors of another structure.
"""

import inspect
import types
import typing
from collections.abc import Callable, Hashable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, Union, get_args, get_origin

import numpy as np
import pytest

import equimorph as em
from argument_faults import outcome
from equimorph.argument_checks import CHECKED
from equimorph.argument_kinds import NUMBERS
from equimorph.errors import InputError
from equimorph.tasks.planning.objectives import Extreme
from oracles.specimens import arch_truss, toggle
from typecheck import unchecked

LEAST_CALLS = 3000
LEFT_OUT = {"house_style", "write_surface"}


class Things:
    """Right arguments by their names and types, and those of another structure."""

    def __init__(self) -> None:
        spring, rod = em.Spring(), em.Rod()
        self.spring, self.rod = spring, rod
        self.set = em.equilibrium_set(
            spring, em.Box(x_l=(0.6, 1.3), F=(-0.5, 0.5)), intervals=(3, 3), checks=0
        )
        self.other_set = em.equilibrium_set(
            rod, em.Box(Delta=(-1.0, 1.0)), fixed={"Theta": 0.5}, intervals=(3,), checks=0
        )
        self.state = em.lift(spring.natural_state(x_l=1.2), {"F": 0.1}).end.state
        self.other_state = rod.natural_state(Theta=0.5)
        self.path = em.lift(self.state, {"F": 0.2})
        self.map = em.limit_load_map(spring, em.Grid(x_l=(0.6, 0.9, 2), k=(1.0, 2.0, 2)), "F")
        self.route = em.plan(self.set, self.state, self.path.end.state)
        self.limit = em.limit_load(spring.natural_state(x_l=0.8), "F")
        self.estimate = em.estimate_state(
            self.set, {spring.angle: 0.3, "F": 0.1}, {spring.angle: 0.1, "F": 0.1}
        )
        self.truss = arch_truss("green")
        self.frame = toggle()
        self.chart = em.Projection(em.manifold.part(self.set, self.set.cell_index == 0))

    def right(self, name: str, annotation: Any) -> Any:
        """A right value of a parameter; `MISSING` if none is known."""
        if name in self.by_name:
            return self.by_name[name]
        for kind in flat(annotation):
            made = self.of_kind(kind)
            if made is not MISSING:
                return made
        return MISSING

    @property
    def by_name(self) -> Mapping[str, Any]:
        """Right values of parameters whose types tell too little."""
        angle = self.spring.angle
        return {
            "load": "F", "along": "F", "parameter": "F", "imperfection": "x_l",
            "parameters": ["F", "x_l"], "names": ["x_l"], "actuators": ["x_l"],
            "at": {"F": 0.1, "x_l": 1.0}, "fixed": {}, "offsets": {"F": 0.01},
            "spreads": {"F": 0.01}, "tolerances": {"F": 0.01}, "to": {"F": 0.2},
            "measured": {angle: 0.3, "F": 0.1}, "errors": {angle: 0.1, "F": 0.1},
            "targets": {angle: 0.3}, "intervals": (3, 3),
            "descriptors": [angle, self.spring.height],
            "chosen": [angle, self.spring.height], "via": [{"F": 0.1}], "loads": [{"F": 0.1}],
            "grid": em.Grid(x_l=(0.6, 1.3, 2), F=(-0.5, 0.5, 2)), "ends": (0.0, 0.2),
            "schedule": [{"F": 0.2}], "path": Path("nowhere.h5"), "text": "angle",
            "centre": (0.0, 0.0), "point": (0.0, 0.0), "normal": (0.0, 1.0), "bound": 2.0,
            "sizes": (1e-3, 3e-4, 1e-4), "could_measure": {angle: 0.1}, "limits": {"F": 1.0},
            "joints": {"A": (-1, 0), "B": (0, 0.1), "C": (1, 0)}, "bars": [("A", "B"), ("B", "C")],
            "members": [("A", "B"), ("B", "C")], "supports": {"A": "xy", "C": "xy"},
            "way_points": [{"F": 0.2}], "variables": {"B": (0.4, 2.5)}, "energy": "x**4",
        }  # fmt: skip

    def of_kind(self, kind: Any) -> Any:
        """A right value of a type."""
        angle = self.spring.angle
        made: Mapping[Any, Any] = {
            em.Structure: self.spring, em.State: self.state, em.States: self.path.states,
            em.EquilibriumSet: self.set, em.Descriptor: angle, em.Constraint: angle <= 1.0,
            em.Box: em.Box(x_l=(0.6, 1.3), F=(-0.5, 0.5)), em.LimitLoad: self.limit,
            em.LimitLoadMap: self.map, em.Route: self.route, em.Path: self.path,
            em.TraceOptions: em.TraceOptions(), em.SamplingOptions: em.SamplingOptions(),
            em.LoadLimit: em.LoadLimit(self.state, "F"),
            em.Rates: em.Rates({"F": 1.0, "x_l": 1.0, "k": 1.0}), Extreme: em.peak(angle),
            em.Disc: em.Disc((0.0, 0.0), 1.0), em.charts.Rule: em.charts.lowest(angle),
            int: 2, float: 0.5, bool: False, str: "angle",
        }  # fmt: skip
        if kind in made:
            return made[kind]
        if get_origin(kind) is Literal:
            return get_args(kind)[0]
        if get_origin(kind) is Sequence:
            inside = self.right("", get_args(kind)[0])
            return MISSING if inside is MISSING else [inside]
        if get_origin(kind) is Mapping:
            inside = self.of_kind(flat(get_args(kind)[1])[0])
            return MISSING if inside is MISSING else {"F": inside}
        return np.array if get_origin(kind) is Callable else MISSING


MISSING = object()


def flat(annotation: Any) -> list[Any]:
    """Alternatives of an annotation, None among them."""
    if get_origin(annotation) is Annotated:
        plain, note, *_ = get_args(annotation)
        return [note] if note is NUMBERS else flat(plain)
    if get_origin(annotation) in (Union, types.UnionType):
        return [kind for each in get_args(annotation) for kind in flat(each)]
    return [annotation]


ODD = (object(), 3 + 4j, b"bytes", np.array([1j]), {1: 2}, [[None]], {"nothing": "text"})
NONE = types.NoneType
NOT_NUMBERS = (np.nan, "2", [2], {}, np.array([1.0, 2.0]))
NEGATIVE = (-1.0, -1e-300)
WHERE: Sequence[tuple[set[Any], set[Any], Sequence[Any]]] = (
    (set(), {NONE, None}, (None,)),
    (set(), {str, Path, Literal}, ("text", "", "0.5")),
    (set(), {int, float, bool, Callable}, (0.5, 7, np.nan, True)),
    (set(), {Callable}, (np.sin,)),
    ({int, float}, {str}, NOT_NUMBERS),
    ({int}, {str}, (-1, 2.5, -(10**9), np.inf)),
    ({bool}, set(), (1, 0.0, "yes", np.nan, [True])),
)
"""Values that are wrong where one of some types is allowed, and none of others."""
NAMED: Mapping[str, Sequence[Any]] = {
    **dict.fromkeys(("margin", "accuracy", "tolerance", "most", "snap_price"), NEGATIVE),
    **dict.fromkeys(("distance", "reach"), NEGATIVE),
    **dict.fromkeys(("starts", "runs", "trials", "checks", "samples", "count"), (10**15, 10**400)),
}
ANY_NAME = {"limits", "nominal", "sizes"}
"""Arguments whose names are looked up later, in a structure."""
UNBOUNDED = {"lower", "upper", "margin", "period"}


def wrong(name: str, annotation: Any, things: Things) -> Iterator[Any]:
    """Values that a parameter must not have."""
    kinds = flat(annotation)
    bare = {get_origin(kind) or kind for kind in kinds}
    if bare & {Any, Hashable}:
        return
    yield from ODD
    if NUMBERS in bare:
        return
    for some, but, values in WHERE:
        if (not some or bare & some) and not bare & but:
            yield from values
    if float in bare and name not in UNBOUNDED:
        yield from (np.inf, -np.inf, 10**400)
    yield from NAMED.get(name, ())
    yield from (value for kind, value in ((em.EquilibriumSet, things.set), (em.State, things.state))
                if kind not in bare)  # fmt: skip
    yield from wrong_lists(kinds, things)
    yield from wrong_mappings(name, kinds, things)
    yield from of_another_structure(kinds, things)


class OfAnother:
    """A value that is wrong only beside others, of another structure."""

    def __init__(self, value: Any) -> None:
        self.value = value


def wrong_lists(kinds: Sequence[Any], things: Things) -> Iterator[Any]:
    """Lists with a wrong entry."""
    angle = things.spring.angle
    for kind in kinds:
        if get_origin(kind) is Sequence:
            yield from ([object()], [None], [1j], [things.set])
            yield from () if float in kinds else (3,)
            if get_args(kind) == (em.Constraint,):
                yield from (angle <= 1.0, "angle <= 1", ["angle <= 1"], [angle])
            if get_args(kind) == (em.Descriptor,):
                yield from (angle, ["angle"])


def wrong_mappings(name: str, kinds: Sequence[Any], things: Things) -> Iterator[Any]:
    """Mappings with a wrong key or value."""
    for kind in kinds:
        keys, values = get_args(kind) if get_origin(kind) is Mapping else (None, None)
        if float in flat(values):
            key = things.spring.angle if em.Descriptor in flat(keys) else "F"
            yield from ({key: value} for value in ("0.5", 1j, np.nan, np.inf, [0.1], object()))
            yield from ([("F", 0.1)], {things.state: 0.1})
            yield from [{"no such name": 0.1}] if name not in ANY_NAME else []


def of_another_structure(kinds: Sequence[Any], things: Things) -> Iterator[OfAnother]:
    """Right values of another structure."""
    other = {
        em.State: things.other_state,
        em.States: things.other_state.batch,
        em.EquilibriumSet: things.other_set,
        em.Descriptor: things.rod.max_curvature,
        em.Constraint: things.rod.max_curvature <= 1.0,
    }
    yield from (OfAnother(other[kind]) for kind in kinds if kind in other)
    lists = (get_args(kind)[0] for kind in kinds if get_origin(kind) is Sequence)
    yield from (
        OfAnother([other[kind]]) for kind in lists if isinstance(kind, type) and kind in other
    )


def public_functions(things: Things) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Functions, classes and methods that users call."""
    named = {name: getattr(em, name) for name in em.__all__}
    for layer in ("charts", "equilibria", "manifold", "model", "structures", "storage", "plotting"):
        exported = vars(getattr(em, layer)).items()
        named |= {name: thing for name, thing in exported if not name.startswith("_")}
    for name, thing in named.items():
        called = thing.__init__ if inspect.isclass(thing) else thing
        if is_checked(called) and name not in LEFT_OUT:
            yield f"{thing.__module__}.{name}", thing
    pieces = em.components(things.set)
    for owner in (things.set, things.chart, things.map, things.state, things.path.states, pieces,
                  things.spring, things.rod, things.truss, things.frame):  # fmt: skip
        for name, method in inspect.getmembers(type(owner), inspect.isfunction):
            if is_checked(method) and name != "__init__":
                yield f"{type(owner).__name__}.{name}", getattr(owner, name)


def is_checked(function: Any) -> bool:
    """Whether the arguments of a function are checked."""
    return hasattr(function, CHECKED)


def single_faults(
    things: Things, function: Callable[..., Any]
) -> Iterator[tuple[str, Any, Mapping[str, Any]]]:
    """Right arguments of a function but for one: its name and value, and all."""
    target = function.__init__ if inspect.isclass(function) else function
    hints = typing.get_type_hints(inspect.unwrap(target), include_extras=True)
    parameters = dict(inspect.signature(function).parameters)
    right: dict[str, Any] = {}
    for name, each in parameters.items():
        value = things.right(name, hints.get(name, Any))
        needed = each.default is inspect.Parameter.empty and each.kind not in VARIABLE
        if needed and value is not MISSING:
            right[name] = value
    for name, each in parameters.items():
        if each.kind not in VARIABLE:
            for value in wrong(name, hints.get(name, Any), things):
                beside = value.value if isinstance(value, OfAnother) else value
                if isinstance(value, OfAnother) and len(belonging(right, name)) == 0:
                    continue
                yield name, beside, {**right, name: beside}


VARIABLE = (inspect.Parameter.VAR_POSITIONAL, inspect.Parameter.VAR_KEYWORD)


def belonging(right: Mapping[str, Any], but: str) -> list[str]:
    """Arguments besides one that belong to a structure."""
    owners = em.State | em.States | em.EquilibriumSet | em.Structure
    return [name for name, value in right.items() if name != but and isinstance(value, owners)]


@pytest.fixture(scope="module")
def things():
    return Things()


def test_every_single_fault_is_refused_in_one_line(things, tmp_path, monkeypatch):
    """No raw error, nothing wrong is accepted silently."""
    monkeypatch.chdir(tmp_path)
    leaks, calls = [], 0
    for label, function in public_functions(things):
        for name, value, arguments in single_faults(things, function):
            calls += 1
            told = outcome(function, arguments)
            if told:
                leaks.append(f"{label}({name}={value!r:.60}): {told:.120}")
    assert list(tmp_path.iterdir()) == []
    assert not leaks, f"{len(leaks)} of {calls}:\n" + "\n".join(leaks[:100])
    assert calls >= LEAST_CALLS


def test_every_public_function_is_checked():
    """Classes that users do not construct, as they are returned, need not be."""
    public = (getattr(em, name) for name in em.__all__)
    functions = [each for each in public if inspect.isfunction(each)]
    assert len(functions) > 50
    assert [each.__name__ for each in functions if not is_checked(each)] == []


def test_a_name_that_is_no_argument_is_refused_with_those_that_are(things):
    """Every public function, constructor and method, and the nearest name if one is close."""
    calls = 0
    for label, function in public_functions(things):
        parameters = inspect.signature(function).parameters
        if any(each.kind is inspect.Parameter.VAR_KEYWORD for each in parameters.values()):
            continue
        known = ", ".join(name for name, each in parameters.items() if each.kind not in VARIABLE)
        with unchecked(), pytest.raises(InputError, match=r"; got qqq\.$") as refused:
            function(qqq=1)
        said, calls = str(refused.value), calls + 1
        assert "\n" not in said, label
        assert f"must have arguments among {known or 'none'}; got" in said, label
    assert calls > 150


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (lambda: em.Member(("A", "B"), curvatur=1.0), r"got curvatur. Did you mean curvature\?$"),
        (em.limit_load, r"`limit_load` must have the argument state; got n"),
        (lambda: em.Spring(1.0, 2.0, 3.0, 4.0), r"among .*; got 4 without names\.$"),
        (
            lambda: em.Spring(1.0, stiffness=2.0),
            r"^`Spring` must have each argument once; got \w+ by place and by name\.$",
        ),
    ],
)
def test_calls_with_too_few_or_too_many_values_are_refused(call, said):
    with unchecked(), pytest.raises(InputError, match=said):
        call()


def test_the_schedule_of_a_refused_route_is_named():
    with unchecked(), pytest.raises(InputError, match="A refused route has no schedule") as refused:
        em.verify(None)
    assert str(refused.value).startswith("`schedule` must be a schedule")


def test_what_belongs_to_another_structure_is_refused():
    """States and descriptors of equal structures are those of the same, whenever made."""
    rod, spring = em.Rod(), em.Spring()
    state = spring.natural_state(x_l=1.2)
    with pytest.raises(InputError, match=r"`within` must describe the structure Spring"):
        em.lift(state, {"F": 0.1}, within=[rod.max_curvature <= 1.0])
    with pytest.raises(InputError, match=r"`structure` must be of the same structure as `start`"):
        em.verify([{"F": 0.1}], state, structure=rod)
    assert em.lift(state, {"F": 0.1}, within=[em.Spring().angle <= 9.0]).arrived


def test_what_signatures_do_not_tell_of_a_design_is_refused(things):
    """Families and bounds that take other variables or return other things, texts as bounds."""
    limit, bounds, correlated = (
        em.LoadLimit(things.state, "F"),
        {"stiffness": (1.0, 2.0)},
        np.eye(3),
    )
    wrong = [
        (em.design, (em.Spring, {"C": (1.0, 2.0)}, limit)),
        (em.design, (em.Spring, {"": (1.0, 2.0)}, limit)),
        (em.design, (lambda stiffness: stiffness, bounds, limit)),
        (em.design, (em.Spring, {"stiffness": ("1", "2")}, limit)),
        (em.design, (em.Spring, bounds, [])),
        (em.LoadLimit, (things.state, "no such load")),
        (em.StateValue, (things.state, em.peak(things.rod.max_curvature))),
        (em.Errors, ({"F": 0.1, "k": 0.1}, 0.9, [[1.0, 0.0], [0.0]])),
        (em.Errors, ({"F": 0.1, "k": 0.1}, 0.9, correlated)),
    ]
    functions = (lambda B: B, lambda stiffness: "text", lambda stiffness: 1j)
    of = [[em.DesignBound(each, 0.0, 1.0)] for each in functions]
    for call, given in [*wrong, *((em.design, (em.Spring, bounds, limit, each)) for each in of)]:
        with unchecked(), pytest.raises(InputError, match="; got ") as refused:
            call(*given)
        assert "\n" not in str(refused.value)


@pytest.mark.parametrize("value", [1, np.float32(0.5), np.int64(2), np.array(0.5)])
def test_real_numbers_of_all_types_are_numbers(value):
    """Zero-dimensional arrays become numbers."""
    with unchecked():
        assert em.lift(em.Spring().natural_state(x_l=1.2), {"F": 0.1 * value}).arrived
    assert em.TraceOptions(largest_step=value).largest_step == value


def test_lists_are_taken_where_arrays_are_asked_for():
    state = em.Spring().natural_state(x_l=1.2)
    with unchecked():
        np.testing.assert_array_equal(state.shape([0.0, 1.0]), state.shape(np.array([0.0, 1.0])))


def test_arguments_are_refused_under_the_name_of_their_parameter():
    """A parameter says what it allows in its own words, in checks of arguments as elsewhere."""
    said = r"^`k` must be a finite number greater than 0; got 'stiff'\.$"
    with unchecked(), pytest.raises(InputError, match=said):
        em.find_equilibria(em.Spring(), {"F": 0.1, "k": "stiff"})
