"""Everything public goes through pickles and copies, and is the same bit for bit after that."""

import copy
import inspect
import pickle
import typing
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

import equimorph as em
from oracles.specimens import SPECIMENS
from same_records import assert_equal
from test_argument_checks import MISSING, VARIABLE, Things, public_functions
from test_constructor_checks import RIGHT, made
from typecheck import unchecked

NO_RESULTS = ("plotting", "storage", "explorer", "repr_html")
"""Functions that draw or write."""
LEAST_RESULTS = 60


def over_half(s: Any) -> Any:
    return 1.0 + (s > 0.5)


def back(thing: Any) -> Any:
    return pickle.loads(pickle.dumps(thing))


@pytest.mark.parametrize(("kind", "given"), RIGHT, ids=[kind.__name__ for kind, _ in RIGHT])
def test_whatever_is_constructed_comes_back(kind, given):
    thing = made(kind, given)
    again = back(thing)
    assert type(copy.deepcopy(thing)) is kind
    if isinstance(thing, em.Structure):
        assert again.signature == thing.signature
        assert all(back(each) == each for each in described(thing))
    else:
        assert repr(again) == repr(thing)


@pytest.mark.parametrize("specimen", SPECIMENS, ids=lambda specimen: specimen.name)
def test_a_structure_that_comes_back_computes_the_same_bits(specimen):
    """Identity: the constructor makes of equal data equal tables."""
    z, p, *_ = specimen.states()
    with unchecked():
        again = back(specimen.structure)
        for method in ("energy", "residual", "effort", "index"):
            one, other = (getattr(each, method)(z, p) for each in (specimen.structure, again))
            np.testing.assert_array_equal(one, other, err_msg=method)
        for descriptor in described(specimen.structure):
            same = back(descriptor)
            assert same == descriptor
            one, other = (each.function(z, p) for each in (descriptor, same))
            np.testing.assert_array_equal(one, other, err_msg=descriptor.name)


def described(structure: em.Structure) -> list[em.Descriptor]:
    """Descriptors that need no arguments, and some of those that all structures have."""
    name = structure.parameters[0].name
    own = []
    for text in structure.written:
        with suppress(em.InputError):  # arguments are missing, or stiffnesses
            own.append(structure.descriptor(text))
    return [
        *own,
        structure.elevation,
        *structure.watched,
        *(each.descriptor for each in structure.validity),
        em.value_of(structure, name),
        abs(em.effort_of(structure, name)),
        em.margin_of(structure),
        em.distance_to(structure, em.Disc((0.0, 1.0 / 3.0), 0.1)),
        em.structures.shape_coordinate(structure, "x", 1.0 / 3.0),
    ]


def test_members_of_one_pickle_share_their_structure():
    arch = em.Rod(load="uniform")
    state, bound = back((arch.natural_state(Theta=0.9), arch.height(1 / 3) <= 0.2))
    assert bound == (arch.height(1 / 3) <= 0.2)
    assert bound.holds(state.batch).shape == (1,)
    assert copy.deepcopy(state).structure is state.structure
    assert copy.deepcopy(bound).descriptor is bound.descriptor


def test_functions_at_the_top_of_a_module_come_back():
    rod = em.Rod(load=over_half)
    assert back(rod).natural_state(Theta=0.5).energy == rod.natural_state(Theta=0.5).energy
    gap = em.function_of("gap", np.subtract, rod.height(0.2), rod.height(0.7))
    rest = em.Rod(load=over_half).natural_state(Theta=0.5)
    assert back(gap)(rest) == gap(rest)
    assert back(em.LineLoad(over_half)).shape is over_half


@pytest.mark.parametrize(
    ("make", "name"),
    [
        (lambda: em.Rod(load=lambda s: 1.0 + s), "Rod"),
        (lambda: em.Rod(stiffness=lambda s: 1.0 + s), "Rod"),
        (lambda: em.LineLoad(lambda s: 1.0 + s), "LineLoad"),
        (lambda: em.Descriptor("first", "1", lambda z, p: z[:, 0]), "first"),
        (lambda: em.function_of("twice", lambda a: 2 * a, em.Spring().angle) <= 1.0, "twice"),
        (
            lambda: em.Family(lambda stiffness: em.Spring(2 * stiffness), {"stiffness": 1.0}),
            "Family",
        ),
        (lambda: em.charts.rules.by_score(lambda states: states.energy), "by score"),
    ],
)
def test_a_function_without_a_name_is_refused_in_one_line(make, name):
    """Other processes could not import it."""
    with pytest.raises(em.InputError) as refused:
        pickle.dumps(make())
    said = str(refused.value)
    assert said.startswith(f"`{name}` must be made of functions that stand at the top of a module")
    assert "<lambda>" in said
    assert "\n" not in said


@pytest.mark.slow  # it calls every public function
def test_what_public_functions_return_comes_back_bit_for_bit(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with unchecked():
        things = Things()
        results = [*further_results(things)]
        for label, function in public_functions(things):
            if not any(word in label for word in NO_RESULTS):
                results.append(result_of(function, things))
        seen = {type(each).__name__ for each in results}
        for each in results:
            assert_equal(back(each), each)
            copy.deepcopy(each)
    assert len(seen) >= LEAST_RESULTS, sorted(seen)


def result_of(function: Any, things: Things) -> Any:
    """Result of a function of right arguments; None where these do not fit each other."""
    target = function.__init__ if inspect.isclass(function) else function
    hints = typing.get_type_hints(inspect.unwrap(target), include_extras=True)
    right = {
        name: things.right(name, hints.get(name, Any))
        for name, each in inspect.signature(function).parameters.items()
        if each.default is inspect.Parameter.empty and each.kind not in VARIABLE
    }
    try:
        return function(**{name: value for name, value in right.items() if value is not MISSING})
    except (em.InputError, TypeError, ValueError):
        return None


def further_results(things: Things) -> list[Any]:
    """Results for which arguments must fit each other."""
    eset, spring, route = things.set, things.spring, things.route
    angle, goal, fold = spring.angle, things.path.end.state, things.limit.state
    load = em.value_of(spring, "F")
    tall = em.Truss(
        {"A": (-1.0, 0.0), "B": (0.0, 3.0), "C": (1.0, 0.0)}, [("A", "B"), ("B", "C")],
        {"A": "xy", "C": "xy"}, {"F": {"B": (0.0, -1.0)}},
    )  # fmt: skip
    plant = em.SimulatedPlant(things.state, simulator="own")
    over = em.equilibrium_set(
        spring, em.Box(x_l=(0.6, 1.3)), fixed={"F": 0.05}, intervals=(8,), checks=0
    )
    controller = em.Controller(over, over.at(x_l=1.2)[0], {angle: 0.1}, {"F": 0.01})
    return [
        plant.move({"F": 0.12}), plant, controller, over.audit, em.Rates({"F": 1.0}),
        em.branches(em.lift(em.natural_state(tall), {"F": 2.0}).end.state, "F"),
        em.fold_curve(fold, ["F", "x_l"]), em.snap_landing(fold, at={"F": 1e-3}),
        em.limit_load(things.path.states[:2], "F"),
        em.solve_shapes(eset, {angle: np.array([0.3, 0.4]), load: np.full(2, 0.1)}),
        em.verify(route.schedule, route.path.states[0], proof=True),
        em.speed_limit(route.schedule, 0.1),
        em.retime(route.schedule, em.Rates({"F": 1.0, "x_l": 1.0})),
        em.replay(route.schedule, simulator="own", rate=0.5),
        em.curvature_map(spring, em.Grid(x_l=(0.6, 0.9, 2), k=(1.0, 2.0, 2)), "F", 0.01,
                         descriptor=angle),
        em.alternatives(eset, things.state, goal), eset.at(x_l=1.0, F=0.1), eset.folds,
        em.plan_sampled(things.state, goal, em.Box(F=(-0.5, 0.5), x_l=(0.6, 1.3))),
        em.landscape(eset, angle, em.Grid(x_l=(0.7, 1.2, 3), F=(-0.3, 0.3, 3))),
        em.reduce(eset, prefer=em.quasi_static("F")),
    ]  # fmt: skip
