"""What answers of several kinds have in common: states of the set, ways on it, snaps on a way."""

from collections.abc import Iterable, Mapping, Sequence
from functools import partial
from html import escape
from typing import Literal

from equimorph import plotting
from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint, Descriptor
from equimorph.plotting.curves import snap_steps
from equimorph.structures import State, States
from equimorph.study import html
from equimorph.study.question import Figure, Question, moving, still
from equimorph.tasks.motion.tracking import Tracking
from equimorph.tasks.route import Route
from equimorph.tasks.verification.schedule_check import Verification


def figures_of_states(question: Question, states: States) -> list[Figure]:
    """Where the states lie on the plane of two free parameters."""
    eset = question.eset
    if eset is None or len(eset.names) != 2 or not len(states):
        return []
    draw = partial(plotting.solutions, eset, states)
    return [still(question.files, draw, "Where they lie: full dots are stable.")]


def table_of_states(
    states: States, descriptors: Sequence[Descriptor], more: Mapping[str, list[str]] | None = None
) -> list[str]:
    """Return a table of states, numbered as on their figure."""
    return [html.table_of_states(states, descriptors, more, numbered=True), html.EXPLANATION]


def free_columns(
    states: States, names: Sequence[str], shown: Sequence[Descriptor]
) -> dict[str, list[str]]:
    """Columns with the values of parameters that no descriptor shows."""
    known = {each.name for each in shown}
    return {
        name: [html.number(value, 7) for value in states[name]]
        for name in names
        if name not in known
    }


def place_of(values: State | Mapping[str, float], names: Sequence[str]) -> str:
    """Parameters in words: ``x_l = 0.8, F = 0.02``."""
    return ", ".join(f"{name} = {html.number(round(values[name], 12), 6)}" for name in names)


def count_of(number: int, noun: str) -> str:
    """Return a number with its noun: ``1 run``, ``2 runs``."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def as_route(answer: Tracking | Verification, status: Literal["arrived", "refused"]) -> Route:
    """The way of a motion or a schedule as a route, for figures."""
    way, length = answer.path, float(answer.path.length[-1])
    return Route(status, answer.why, [], way, answer.margin, length, answer.schedule)


def figures_of_way(
    eset: EquilibriumSet | None,
    name: str,
    route: Route,
    what: str,
    bounds: Iterable[Constraint] = (),
) -> list[Figure]:
    """Shapes and margins; the plane (alone if refused) and a film over two parameters.

    Over fewer or more, the parameters that move instead. `what` is "route" or "motion"; `bounds`
    are drawn beside those of the set.
    """
    shapes = still(
        f"{name}-shapes", partial(plotting.shapes, route),
        f"Shapes at equal steps along the {what}, start to goal.",
    )  # fmt: skip
    margins = still(
        f"{name}-margins",
        partial(plotting.margins, route, within=(*bounds, *(eset.constraints if eset else ()))),
        f"How far each state is from instability along the {what}.",
    )  # fmt: skip
    if eset is None or len(eset.names) != 2:
        if not route.arrived or route.schedule is None:
            return []
        draw = partial(plotting.schedule_strips, route.schedule)
        caption = f"Parameters that move along the {what}."
        return [still(f"{name}-parameters", draw, caption), shapes, margins]
    draw_plane = partial(plotting.parameter_plane, eset, route)
    caption = f"The {what} on the plane of the free parameters."
    plane = still(f"{name}-plane", draw_plane, caption)
    draw_film = partial(plotting.film, route, eset=eset)
    film = moving(f"{name}-film", draw_film, f"The structure along the {what}.")
    return [plane, shapes, margins, film] if route.arrived else [plane]


def snaps_in_words(route: Route) -> str:
    """Return how many snaps there are, and what energy they release."""
    if not route.snaps:
        return "without a snap"
    count = len(route.snaps)
    released = html.number(sum(each.released for each in route.snaps))
    verb = "releases" if count == 1 else "release"
    return f"by {count_of(count, 'snap')} that {verb} {released} of energy"


def table_of_snaps(route: Route) -> list[str]:
    """Return a table of the snaps: where, from what to what, and the energy released."""
    if not route.snaps:
        return []
    assert route.path is not None
    before = [route.path.states[int(step)] for step in snap_steps(route)]
    height, energy = before[0].structure.elevation, before[0].structure.descriptor("energy")
    varies = route.path.states.p.max(axis=0) > route.path.states.p.min(axis=0)
    parameters = zip(before[0].structure.parameters, varies, strict=True)
    moved = [each.name for each, is_moved in parameters if is_moved]
    rows = [
        [
            str(number),
            *(html.number(state[name], 6) for name in moved),
            html.number(float(height(state)), 5),
            html.number(float(height(snap.state)), 5),
            html.number(snap.released, 5),
        ]
        for number, (state, snap) in enumerate(zip(before, route.snaps, strict=True), 1)
    ]
    named = f"{height.name} ({height.unit})"
    head = ["snap", *moved, f"{named} before", f"{named} after", f"{energy.name} released"]
    return [html.table([escape(each) for each in head], rows)]
