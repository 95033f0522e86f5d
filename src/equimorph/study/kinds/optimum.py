"""Optima: ``[[optimum]]``, ``[[robust_optimum]]``, ``[[follow]]``, ``[[landscape]]``."""

from collections.abc import Mapping
from functools import partial
from html import escape
from types import MappingProxyType

import numpy as np

from equimorph import plotting
from equimorph.model import Schedule
from equimorph.structures import States, join_states
from equimorph.study import html
from equimorph.study.answers import figures_of_states, free_columns, place_of, table_of_states
from equimorph.study.question import DataTable, Figure, Kind, Question, still
from equimorph.tables import Column, Table, units_of
from equimorph.tasks.optimising.certificates import Certificate
from equimorph.tasks.optimising.landscapes import Landscape, landscape
from equimorph.tasks.optimising.moving_optimum import follow_optimum
from equimorph.tasks.optimising.optimum import Optima, optimise
from equimorph.tasks.optimising.optimum_path import FollowedOptimum
from equimorph.tasks.optimising.robust import RobustOptimum, robust_optimum

PRICE_ROUNDING = 1e-12
"""Price that is shown as zero."""


class OptimumKind(Kind[Optima]):
    """The stable states at which an objective is least or largest."""

    table = "optimum"
    tasks = (optimise,)

    def schedules(self, question: Question, answer: Optima) -> Mapping[str, Schedule]:
        """Return that which leads to the best one."""
        return super().schedules(question, answer) if answer.found else {}

    def figures(self, question: Question, answer: Optima) -> list[Figure]:
        """Where they lie."""
        return figures_of_states(question, answer.states) if answer.found else []

    def words(self, question: Question, answer: Optima) -> str:
        """Name the best one."""
        best = answer.best
        value = f"{question['objective'].name} = {html.number(best.value, 6)}"
        where = place_of(best.state, question.free)
        return f"**found**: {value} at {where} ({best.certificate.kind})."

    def details(self, question: Question, answer: Optima) -> list[str]:
        """A table of the optima, best first, with the certificate of each."""
        if not answer.found:
            return []
        certificates = [each.certificate for each in answer.all]
        shown = [question["objective"]]
        more = free_columns(answer.states, question.free, shown)
        more["where"] = [", ".join([each.kind, *each.active]) for each in certificates]
        more["KKT"] = [f"{each.residual:.0e}" for each in certificates]
        return table_of_states(answer.states, shown, more)


class RobustOptimumKind(Kind[RobustOptimum]):
    """The stable state that is best in the worst case over a box of imperfections."""

    table = "robust_optimum"
    tasks = (robust_optimum,)

    def figures(self, question: Question, answer: RobustOptimum) -> list[Figure]:
        """Where the nominal and the robust optimum lie."""
        return figures_of_states(question, _both_optima(answer)) if answer.found else []

    def words(self, question: Question, answer: RobustOptimum) -> str:
        """What is guaranteed, and its price."""
        status = "**found**." if answer.found else f"**not converged**: {answer.why}."
        return f"{status} {_price_in_words(question, answer)}"

    def details(self, question: Question, answer: RobustOptimum) -> list[str]:
        """Both optima in a table."""
        if not answer.found:
            return []
        shown, states = [question["objective"]], _both_optima(answer)
        more = {"": ["nominal optimum", "robust optimum"]}
        more |= free_columns(states, question.free, shown)
        more["worst case"] = [_value(each) for each in (answer.at_risk, answer.guaranteed)]
        return table_of_states(states, shown, more)


def _both_optima(answer: RobustOptimum) -> States:
    """The nominal and the robust optimum."""
    assert answer.nominal is not None
    assert answer.state is not None
    return join_states(answer.state.structure, (answer.nominal.state, answer.state))


def _value(value: float) -> str:
    return html.number(value, 6) if np.isfinite(value) else "stability is lost"


def _price_in_words(question: Question, answer: RobustOptimum) -> str:
    name = question["objective"].name
    assert answer.state is not None
    assert answer.nominal is not None
    errors = ", ".join(f"{each} ± {size:g}" for each, size in answer.offsets.items())
    risk = (
        f"the worst value of the nominal optimum is {html.number(answer.at_risk, 6)}"
        if np.isfinite(answer.at_risk)
        else "the nominal optimum may lose its stability"
    )
    edge = ""
    if answer.edge:
        away = {each: x * answer.offsets[each] for each, x in answer.edge.items()}
        at = ", ".join(f"{x:+.3g} in {each}" for each, x in away.items())
        edge = f" Its box touches the edge of stability at offsets {at.replace('-', '−')}."
    return (
        f"With errors {errors} {risk}. At {place_of(answer.state, question.free)} {name} is "
        f"{html.number(answer.guaranteed, 6)} in the worst case, and "
        f"{html.number(answer.value, 6)} without errors: its price is "
        f"{html.number(answer.price if answer.price > PRICE_ROUNDING else 0.0)}.{edge}"
    )


MOST_ROWS = 12
"""Optima that a page shows."""
MARGIN_ROUNDING = 1e-9
"""Margin on the stability boundary, where it is zero."""


class FollowKind(Kind[FollowedOptimum]):
    """How the best state moves while loads and targets do, and where it jumps."""

    table = "follow"
    tasks = (follow_optimum,)
    names = MappingProxyType({"to": "targets"})
    within_set = True

    def figures(self, question: Question, answer: FollowedOptimum) -> list[Figure]:
        """Objective and actuators along the legs."""
        if not len(answer.states):
            return []
        actuators = tuple(question["actuators"])
        draw = partial(plotting.followed, answer, question["objective"], actuators)
        caption = "Objective and actuators along the legs; dotted where the optimum jumps."
        return [still(question.files, draw, caption)]

    def words(self, question: Question, answer: FollowedOptimum) -> str:
        """Both ends, and how often it jumps."""
        first, last = (html.number(answer.values[k], 6) for k in (0, -1))
        jumps = len(answer.jumps)
        often = {0: "does not jump", 1: "jumps once"}.get(jumps, f"jumps {jumps} times")
        name = question["objective"].name
        return f"**arrived**: {name} goes from {first} to {last} and {often}."

    def details(self, question: Question, answer: FollowedOptimum) -> list[str]:
        """Jumps, and optima along the way."""
        if not len(answer.states):
            return []
        return [*_jumps(question, answer), _table(question, answer)]

    def refusal(self, question: Question, answer: FollowedOptimum) -> str:
        """Reason why the optimum could be followed no further, and where."""
        if answer.arrived or not len(answer.at):
            return answer.why
        return f"After {html.number(answer.at[-1])} of {len(question['to'])} legs: {answer.why}."


def _jumps(question: Question, found: FollowedOptimum) -> list[str]:
    """Table of both sides of every jump."""
    if not found.jumps:
        return []
    names = list(question["actuators"])
    rows = [
        [
            html.number(jump.at, 6),
            *(html.number(value, 6) if np.isfinite(value) else "none" for value in jump.values),
            *(
                f"{html.number(jump.before[name], 5)} → "
                f"{'none' if jump.after is None else html.number(jump.after[name], 5)}"
                for name in names
            ),
        ]
        for jump in found.jumps
    ]
    value = escape(question["objective"].name)
    return [html.table(["jump at leg", f"{value} before", "after", *map(escape, names)], rows)]


def _limits(certificate: Certificate) -> list[str]:
    """Active constraints but stability, which the kind of the optimum shows."""
    return [each for each in certificate.active if not each.startswith("stable ")]


def _table(question: Question, found: FollowedOptimum) -> str:
    """Selected optima along the way."""
    names = list(question["actuators"])
    shown = np.unique(np.linspace(0, len(found.states) - 1, MOST_ROWS).round().astype(int))
    states = found.states
    margins = states.margin
    rows = [
        [
            html.number(found.at[k], 4),
            *(html.number(states[name][k], 6) for name in names),
            html.number(found.values[k], 6),
            html.number(margins[k] if abs(margins[k]) > MARGIN_ROUNDING else 0.0),
            escape(", ".join([found.certificates[k].kind, *_limits(found.certificates[k])])),
        ]
        for k in shown.tolist()
    ]
    titles = ["leg", *names, question["objective"].name, "margin", "where"]
    return html.table([escape(title) for title in titles], rows)


NO_JUMP = 1e-9
"""Jump relative to the values that is rounding."""


class LandscapeKind(Kind[Landscape]):
    """The best stable state at every setting, with barriers and gaps between them."""

    table = "landscape"
    tasks = (landscape,)

    def tables(self, question: Question, answer: Landscape) -> list[DataTable]:
        """Return settings with their values, and the edges that cross barriers."""
        names, axes = answer.grid.names, answer.grid.axes()
        own, objective = question.structure.parameters, question["objective"]
        units = units_of((*own, objective))
        places = zip(names, np.meshgrid(*axes, indexing="ij"), strict=True)
        settings = {name: each.ravel() for name, each in places}
        settings[objective.name] = answer.value.ravel()
        barriers = answer.barriers
        edges: dict[str, Column] = {"kind": barriers.kind}
        for end in (0, 1):
            for k, name in enumerate(names):
                edges[f"{name} {end + 1}"] = barriers.ends[:, end, k]
                units[f"{name} {end + 1}"] = units[name]
        for end in (0, 1):
            edges[f"value {end + 1}"] = barriers.values[:, end]
            units[f"value {end + 1}"] = objective.unit
        files = question.files
        return [
            DataTable(f"{files}.csv", "settings", Table(settings, units)),
            DataTable(f"{files}-barriers.csv", "barriers", Table(edges, units)),
        ]

    def figures(self, question: Question, answer: Landscape) -> list[Figure]:
        """Return the map with barriers and gaps."""
        objective = question["objective"]
        draw = partial(plotting.landscape, question.structure, answer, objective)
        caption = f"The {_word(question)} {objective.name} of stable states at each setting."
        return [still(question.files, draw, caption)]

    def words(self, question: Question, answer: Landscape) -> str:
        """Range, gaps and barriers in one line."""
        return "; ".join(f"{what}: {value}" for what, value in _summary(question, answer)) + "."

    def details(self, question: Question, answer: Landscape) -> list[str]:
        """What barriers mean, and the largest jump there."""
        jumps = np.abs(np.diff(answer.barriers.values, axis=1)).ravel()
        highest = ""
        if len(jumps):
            real = jumps.max() > NO_JUMP * np.abs(answer.barriers.values).max()
            where = f"there by at most {html.number(jumps.max())}" if real else "nowhere"
            highest = f" The value itself jumps {where}."
        return [
            "<p>At a barrier of stability the best state is lost on the way to the neighbouring "
            "setting; at one of preference it goes on, but another one is better there."
            f"{highest}</p>"
        ]


def _word(question: Question) -> str:
    return "least" if question.section.sense == "min" else "largest"


def _summary(question: Question, found: Landscape) -> list[tuple[str, str]]:
    """Summary, by name."""
    total, gaps = found.gaps.size, int(found.gaps.sum())
    known = found.value[~found.gaps]
    rows = []
    if len(known):
        ends = f"{html.number(known.min(), 6)} to {html.number(known.max(), 6)}"
        rows.append((f"{_word(question)} {question['objective'].name}", ends))
    rows.append(("settings without an allowed stable state", f"{gaps} of {total}"))
    for kind in ("stability", "preference"):
        count = sum(each == kind for each in found.barriers.kind)
        rows.append((f"grid edges that cross a barrier of {kind}", str(count)))
    return rows
