"""Motions: ``[[motion]]`` with the files that controllers read, ``[[replay]]``, ``[[track]]``."""

from collections.abc import Sequence
from functools import partial
from html import escape
from pathlib import Path
from types import MappingProxyType

import numpy as np
from pydantic import Field

from equimorph import plotting
from equimorph.dynamics import Replay, replay
from equimorph.model import Schedule, names_of
from equimorph.storage import write_trajectory
from equimorph.storage.trajectory import trajectory_message
from equimorph.study import html
from equimorph.study.answers import as_route, figures_of_way, place_of
from equimorph.study.fields import Positive
from equimorph.study.lookup import at_key
from equimorph.study.question import DataTable, Figure, Kind, Question, moving, still
from equimorph.tables import Table, units_of
from equimorph.tasks.motion.tracking import Tracking, track
from equimorph.tasks.timing.retiming import retime
from equimorph.tasks.verification.schedule_check import Verification


class MotionKind(Kind[Verification]):
    """A motion along a schedule with limited rates, accelerations and jerks."""

    table = "motion"
    tasks = (retime,)
    left_out = ("structure",)
    within_set = True
    own = MappingProxyType(
        {
            "joints": (
                dict[str, str],
                Field(
                    default_factory=dict,
                    description="Joints of a ROS 2 controller by parameter, for a trajectory file.",
                ),
            ),
            "seconds": (
                Positive | None,
                Field(None, description="Length of the unit of time where it is not a second."),
            ),
        }
    )

    def look_up_more(self, question: Question) -> None:
        """Refuse joints that a controller cannot move, before anything is computed."""
        if not question.section.joints:
            return
        structure, parameters = question.structure, question.structure.parameters
        names, roles, units = (
            tuple(getattr(each, part) for each in parameters) for part in ("name", "role", "unit")
        )
        at_rest = np.zeros((1, len(parameters)))
        none, unit = np.zeros(1), structure.time_unit
        resting = Schedule(
            names, roles, units, at_rest, none, none, {}, {}, times=none, time_unit=unit
        )
        with at_key(question.key):
            trajectory_message(resting, question.section.joints, seconds=question.section.seconds)

    def figures(self, question: Question, answer: Verification) -> list[Figure]:
        """As for a route."""
        route = as_route(answer, "arrived" if answer.verified else "refused")
        return figures_of_way(question.eset, question.files, route, "motion", question.within)

    def words(self, question: Question, answer: Verification) -> str:
        """Say how long it takes, and how near to instability it leads."""
        schedule = answer.schedule
        assert schedule is not None
        time = f"{html.number(schedule.duration)} {schedule.time_unit}"
        return (
            f"**{time}** in {len(schedule.values)} samples, smallest margin "
            f"{html.number(answer.margin)}."
        )

    def write_files(self, question: Question, answer: Verification, folder: Path) -> None:
        """Write the schedule and, with joints, the trajectory for their controller."""
        super().write_files(question, answer, folder)
        joints, seconds = question.section.joints, question.section.seconds
        if joints and answer.schedule is not None:
            place = folder / f"{question.files}-trajectory.yaml"
            write_trajectory(answer.schedule, place, joints, seconds=seconds)

    def refusal(self, question: Question, answer: Verification) -> str:
        """Reason why it cannot be executed."""
        return "" if answer.verified else f"{answer.why[:1].upper()}{answer.why[1:]}."


class ReplayKind(Kind[Replay]):
    """A schedule in time, played in a simulator that knows nothing of equilibria."""

    table = "replay"
    tasks = (replay,)
    left_out = ("structure",)

    def figures(self, question: Question, answer: Replay) -> list[Figure]:
        """Deviation over time, and a film beside the statics."""
        deviation = still(
            f"{question.files}-deviation", partial(plotting.deviation_over_time, answer),
            "Largest distance of a point from its equilibrium, over time.",
        )  # fmt: skip
        caption = "The structure in the simulator, and in grey its equilibria."
        shown = partial(plotting.replay_film, answer)
        return [deviation, moving(f"{question.files}-film", shown, caption)]

    def words(self, question: Question, answer: Replay) -> str:
        """Say how far it was from its equilibria."""
        independent = "" if answer.independent else ", which shares the library's equations"
        checked = "" if answer.converged == "not checked" else f" ({answer.converged})"
        return (
            f"**no snap** in the simulator {answer.simulator}{independent}; deviation "
            f"{html.number(answer.largest_deviation, 3)} at most{checked}."
        )

    def refusal(self, question: Question, answer: Replay) -> str:
        """When it snapped, and where it came to rest."""
        if not answer.snapped:
            return ""
        when = "" if answer.where is None else f" at the time {html.number(answer.where)}"
        rest = answer.landed_in
        names = names_of(answer.structure.parameters)
        place = "" if rest is None else f"; it came to rest at {place_of(rest, names)}"
        return f"In the simulator {answer.simulator} the structure snaps{when}{place}."

    def tables(self, question: Question, answer: Replay) -> Sequence[DataTable]:
        """Parameters and deviations over time."""
        names = names_of(answer.structure.parameters)
        parts = ("deviation", "discretisation", "dynamics")
        columns = {"time": answer.times, **dict(zip(names, answer.parameters.T, strict=True))}
        columns |= {each: getattr(answer, each) for each in parts}
        units = units_of(answer.structure.parameters) | {"time": answer.structure.time_unit}
        return [DataTable(f"{question.files}.csv", "deviation over time", Table(columns, units))]


MOST_ROWS = 8
"""Compromises that a page shows."""


class TrackKind(Kind[Tracking]):
    """Actuators that lead descriptors along given targets while loads move."""

    table = "track"
    tasks = (track,)
    within_set = True

    def figures(self, question: Question, answer: Tracking) -> list[Figure]:
        """As for a route."""
        route = as_route(answer, answer.status)
        return figures_of_way(question.eset, question.files, route, "motion", question.within)

    def words(self, question: Question, answer: Tracking) -> str:
        """Say how near to instability it leads, and whether the actuators come back."""
        turn, back = answer.holonomy, ""
        if turn is not None:
            change = max((abs(value) for value in turn.values()), default=0.0)
            back = f" The targets close; the actuators come back within {change:.0e}."
        margin = html.number(answer.margin)
        misses = ", ".join(f"{name} by {html.number(x, 2)}" for name, x in answer.between.items())
        off = f" Between rows of the schedule it misses {misses} at most." if misses else ""
        return f"**arrived** on stable states alone, smallest margin {margin}.{back}{off}"

    def details(self, question: Question, answer: Tracking) -> list[str]:
        """What comes nearest to the targets after a failure."""
        return _compromise(answer)

    def refusal(self, question: Question, answer: Tracking) -> str:
        """Reason why it cannot be followed further, and where."""
        legs = f"{html.number(answer.last_good)} of {len(question['targets'])} legs"
        return "" if answer.arrived else f"After {legs}: {answer.why}"


def _compromise(answer: Tracking) -> list[str]:
    """What comes nearest to the targets after the failure, step by step."""
    found = answer.compromise
    if found is None:
        return []
    words = "The states nearest to the targets, by the sum of squares of what is missed:"
    misses = np.sqrt(2.0 * np.maximum(found.values, 0.0))
    shown = np.unique(np.linspace(0, len(found.states) - 1, MOST_ROWS).round().astype(int))
    names = list(answer.actuators)
    rows = [
        [html.number(found.at[k], 4), html.number(misses[k], 3)]
        + [html.number(found.states[k][name], 6) for name in names]
        for k in shown
    ]
    head = ["leg", "miss", *map(escape, names)]
    return [f"<p>{words}</p>", html.table(head, rows)]
