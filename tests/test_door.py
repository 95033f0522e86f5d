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
from equimorph.argument_kinds import NUMBERS
from equimorph.door import Entry
from equimorph.errors import InputError
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
            "measured": {angle: 0.3, "F": 0.1}, "errors": {angle: 0.1, "F": 0.1}, "intervals": (3, 3),
            "targets": {angle: 0.3}, "descriptors": [angle, self.spring.height],
            "chosen": [angle, self.spring.height], "via": [{"F": 0.1}], "loads": [{"F": 0.1}],
            "grid": em.Grid(x_l=(0.6, 1.3, 2), F=(-0.5, 0.5, 2)), "ends": (0.0, 0.2),
            "schedule": [{"F": 0.2}], "path": Path("nowhere.h5"), "text": "angle",
            "centre": (0.0, 0.0), "point": (0.0, 0.0), "normal": (0.0, 1.0), "bound": 2.0,
            "sizes": (1e-3, 3e-4, 1e-4), "could_measure": {angle: 0.1}, "limits": {"F": 1.0},
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
            em.Disc: em.Disc((0.0, 0.0), 1.0), em.charts.Rule: em.lowest(angle),
            int: 2, float: 0.5, bool: False, str: "angle",
        }  # fmt: skip
        if kind in made:
            return made[kind]
        if get_origin(kind) is Literal:
            return get_args(kind)[0]
        if get_origin(kind) is Sequence:
            inside = self.right("", get_args(kind)[0])
            return MISSING if inside is MISSING else [inside]
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


ODD = (object(), 3 + 4j, b"bytes", np.array(["text"]), {1: 2}, [[None]], {"nothing": "text"})


def wrong(name: str, annotation: Any, things: Things) -> Iterator[Any]:
    """Values that a parameter must not have."""
    kinds = flat(annotation)
    bare = {get_origin(kind) or kind for kind in kinds}
    if bare & {Any, Hashable}:
        return
    yield from ODD
    if NUMBERS in bare:
        return
    if not bare & {None, types.NoneType}:
        yield None
    if not bare & {str, Path, Literal}:
        yield from ("text", "", "0.5")
    if not bare & {int, float, bool} and Callable not in bare:
        yield from (0.5, 7, np.nan, True)
    if not bare & {Callable}:
        yield np.sin
    if not bare & {em.EquilibriumSet}:
        yield things.set
    if not bare & {em.State}:
        yield things.state
    if bare & {int, float} and str not in bare:
        yield from (np.nan, "2", [2], {}, np.array([1.0, 2.0]), -np.nan)
    if int in bare:
        yield from (-1, 2.5, -(10**9), np.inf)
        if name not in ("seed", "to"):
            yield from (10**15, 10**400)
    if float in bare and name not in ("bound", "lower", "upper", "margin"):
        yield from (np.inf, -np.inf, 10**400)
    if name in ("margin", "accuracy", "tolerance", "most", "snap_price", "distance", "reach"):
        yield from (-1.0, -1e-300)
    if bool in bare:
        yield from (1, 0.0, "yes", np.nan, [True])
    yield from wrong_collections(name, kinds, things)
    other = {
        em.State: things.other_state,
        em.States: things.other_state.batch,
        em.EquilibriumSet: things.other_set,
        em.Descriptor: things.rod.max_curvature,
        em.Constraint: things.rod.max_curvature <= 1.0,
    }
    yield from (OfAnother(other[kind]) for kind in kinds if kind in other)


class OfAnother:
    """A value that is wrong only beside others, of another structure."""

    def __init__(self, value: Any) -> None:
        self.value = value


def wrong_collections(name: str, kinds: Sequence[Any], things: Things) -> Iterator[Any]:
    """Lists and mappings with a wrong entry."""
    for kind in kinds:
        inner = get_args(kind)
        if get_origin(kind) is Sequence:
            yield from ([object()], [None], [1j], 3, [things.set])
            if inner == (em.Constraint,):
                angle = things.spring.angle
                yield from (angle <= 1.0, "angle <= 1", ["angle <= 1"], [angle])
                yield OfAnother([things.rod.max_curvature <= 1.0])
            if inner == (em.Descriptor,):
                yield from (things.spring.angle, ["angle"])
                yield OfAnother([things.rod.max_curvature])
        if get_origin(kind) is Mapping and float in flat(inner[1]):
            key = things.spring.angle if em.Descriptor in flat(inner[0]) else "F"
            for value in ("0.5", 1j, np.nan, np.inf, None, [0.1], object()):
                if value is not None or name not in ("to", "targets"):
                    yield {key: value}
            yield from ([("F", 0.1)], {things.state: 0.1})
            if name not in ("limits", "nominal"):
                yield {"no such name": 0.1}


def public_functions(things: Things) -> Iterator[tuple[str, Callable[..., Any]]]:
    """Functions, classes and methods that users call."""
    layers = ("charts", "equilibria", "manifold", "model", "structures", "tasks", "storage")
    for layer in (*layers, "plotting"):
        module = getattr(em, layer)
        for name in module.__all__:
            thing = getattr(module, name)
            if inspect.isfunction(thing) and is_checked(thing) and name not in LEFT_OUT:
                yield f"{layer}.{name}", thing
            elif inspect.isclass(thing) and is_checked(thing.__init__):
                yield f"{layer}.{name}", thing
    for owner in (things.set, things.chart, things.map, things.state, things.path.states,
                  em.components(things.set), things.spring, things.rod):  # fmt: skip
        for name, method in inspect.getmembers(owner, inspect.ismethod):
            if is_checked(method) and name != "__init__":
                yield f"{type(owner).__name__}.{name}", method


def is_checked(function: Any) -> bool:
    """Whether a function stands behind the door."""
    cells = getattr(function, "__closure__", None) or ()
    return any(isinstance(cell.cell_contents, Entry) for cell in cells)


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


def call(function: Callable[..., Any], arguments: Mapping[str, Any]) -> str:
    """Outcome of a call with one fault: empty if it is refused as it should be."""
    parameters = inspect.signature(function).parameters
    first = [name for name, each in parameters.items() if each.kind is each.POSITIONAL_ONLY]
    try:
        with unchecked():
            function(
                *(arguments[name] for name in first if name in arguments),
                **{name: value for name, value in arguments.items() if name not in first},
            )
    except InputError as error:
        text = str(error)
        return "" if "\n" not in text and "; got" in text else f"refused in other words: {text}"
    except Exception as error:
        return f"raw {type(error).__name__}: {error}"
    return "accepted"


@pytest.fixture(scope="module")
def things():
    return Things()


def test_every_single_fault_is_refused_in_one_line(things):
    """No raw error, nothing wrong is accepted silently."""
    leaks, calls = [], 0
    for label, function in public_functions(things):
        for name, value, arguments in single_faults(things, function):
            calls += 1
            outcome = call(function, arguments)
            if outcome:
                leaks.append(f"{label}({name}={value!r:.60}): {outcome:.120}")
    assert not leaks, f"{len(leaks)} of {calls}:\n" + "\n".join(leaks[:100])
    assert calls >= LEAST_CALLS
