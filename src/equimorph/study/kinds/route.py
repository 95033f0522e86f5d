"""Routes: ``[[route]]`` on a set, ``[[sampled_route]]`` for many actuators; ``[[verify]]``."""

from collections.abc import Mapping
from functools import partial
from html import escape
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import AfterValidator

from equimorph import plotting
from equimorph.errors import InputError
from equimorph.model import Schedule
from equimorph.storage import write_certificate
from equimorph.study import html
from equimorph.study.answers import as_route, figures_of_way, snaps_in_words, table_of_snaps
from equimorph.study.composite_arguments import EXTREME
from equimorph.study.fields import Name, Positive, requirement
from equimorph.study.question import (
    PLANE,
    STABLE_PLANE,
    Arguments,
    Figure,
    Kind,
    Question,
    route_name,
    still,
)
from equimorph.study.signatures import MEANINGS
from equimorph.study.states import NaturalSection
from equimorph.tasks.planning.planner import plan
from equimorph.tasks.planning.route_classes import alternatives
from equimorph.tasks.planning.sampling import plan_sampled
from equimorph.tasks.planning.smoothing import smoothed
from equimorph.tasks.route import Route
from equimorph.tasks.verification.evidence import ProofStatus
from equimorph.tasks.verification.proof import Proof
from equimorph.tasks.verification.schedule_check import Verification, verify

Routes = tuple[Route, ...]
"""The route, or its refusal; then alternatives, if the study asks for them."""


def _check_name(name: str) -> str:
    """Refuse names under which files of the set are stored."""
    if f"{name}-plane" in (STABLE_PLANE, PLANE):
        raise requirement("be another name: figures of the set begin with it")
    return name


class RouteKind(Kind[Routes]):
    """Routes between two states: along way-points, planned, with snaps, or several of them."""

    table = "route"
    tasks = (plan, alternatives, smoothed)
    names = MappingProxyType({"count": "alternatives", "tolerance": "smooth"})
    left_out = ("route",)
    own = MappingProxyType(
        {
            "name": (Annotated[Name, AfterValidator(_check_name)], ...),
            "alternatives": (MEANINGS["count"] | None, None),
            "smooth": (Positive | None, None),
        }
    )

    def stems(self, section: Any) -> list[str]:
        """Names of all its routes."""
        return [route_name(section.name, k + 1) for k in range(section.alternatives or 1)]

    def check(self, section: Any) -> None:
        """Refuse demands that exclude each other."""
        given = ("via", "snap_price", "alternatives")
        both = [key for key in given if getattr(section, key) is not None]
        if len(both) > 1:
            raise requirement(f"give one of {', '.join(given)} (not {' and '.join(both)})")
        others = [key for key in ("snap_price", "alternatives", "smooth") if getattr(section, key)]
        extreme = isinstance(section.objective, str) and EXTREME.fullmatch(section.objective)
        if extreme and others:
            raise requirement(f"give one of objective = {section.objective!r}, {others[0]}")
        if section.survive is not None and others:
            raise requirement(f"give one of survive, {others[0]}")
        if section.smooth is not None and section.snap_price is not None:
            raise requirement("give one of smooth, snap_price: routes that snap have corners")

    def look_up_more(self, question: Question) -> None:
        """Refuse alternatives where there is no plane."""
        if question.section.alternatives is not None and len(question.free) != 2:
            raise InputError(
                f"`{question.key}.alternatives` needs a set over two parameters; "
                f"got one over {len(question.free)}."
            )

    def answer(self, question: Question, arguments: Arguments) -> Routes:
        """Plan; round the corners of every route that arrived, if the section says so."""
        if question.section.alternatives is not None:
            routes = tuple(alternatives(**arguments.of(alternatives)))
        else:
            routes = (plan(**arguments.of(plan)),)
        if question.section.smooth is None:
            return routes
        bounds = dict.fromkeys((*arguments.eset.constraints, *question.within))
        demands = arguments.of(smoothed) | {"within": tuple(bounds)}
        return tuple(smoothed(route, **demands) if route.arrived else route for route in routes)

    def schedules(self, question: Question, answer: Routes) -> Mapping[str, Schedule]:
        """Return those of all routes."""
        named = _name_routes(question, answer)
        return {name: route.schedule for name, route in named if route.schedule is not None}

    def figures(self, question: Question, answer: Routes) -> list[Figure]:
        """Shapes, margins, plane and film of the best; all of them on one plane."""
        best = answer[0].bottleneck
        bounds = [*question.within]
        if best is not None:
            bounds.append(question["objective"].bound(best.value, 0.0))
        found = figures_of_way(question.eset, question.name, answer[0], "route", bounds)
        if len(answer) > 1 and question.eset is not None:
            draw = partial(plotting.alternative_routes, question.eset, answer)
            caption = "Routes that cannot be drawn into each other; the first is the best."
            found.insert(0, still(f"{question.name}-alternatives", draw, caption))
        return found

    def words(self, question: Question, answer: Routes) -> str:
        """Say how it arrived."""
        route, smooth = answer[0], question.section.smooth
        least = "" if route.snaps else f"smallest margin {html.number(route.margin)}, "
        size = f"{least}length {html.number(route.length)}{_cost(route)}"
        rounded = "" if smooth is None else f", corners rounded by {html.number(smooth)} at most"
        others = f" {len(answer)} routes differ in how they pass holes." if len(answer) > 1 else ""
        if question.section.alternatives is not None and len(answer) == 1:
            others = " No other route passes the holes of the stable set differently."
        more = f"{others}{_best_possible(question, route)}{_survival(route)}"
        return f"**arrived** {snaps_in_words(route)}, {size}{rounded}.{more}"

    def details(self, question: Question, answer: Routes) -> list[str]:
        """Snaps on the way, and routes side by side where there are several."""
        found = table_of_snaps(answer[0])
        if len(answer) > 1:
            rows = [
                [name, *map(html.number, (route.length, route.margin, route.cost))]
                for name, route in _name_routes(question, answer)
            ]
            head = ["", "length", "smallest margin", escape(answer[0].objective)]
            found.append(html.table(head, rows))
        return found

    def refusal(self, question: Question, answer: Routes) -> str:
        """Reason why there is no route."""
        return "" if answer[0].arrived else answer[0].explanation


def _name_routes(question: Question, answer: Routes) -> list[tuple[str, Route]]:
    return [(route_name(question.name, k), route) for k, route in enumerate(answer, 1)]


def _best_possible(question: Question, route: Route) -> str:
    """The lowest peak that any route has, or the highest least value, and where."""
    best = route.bottleneck
    if best is None:
        return ""
    side = "below" if question["objective"].sign > 0.0 else "above"
    place = ", ".join(f"{name} = {html.number(best.state[name], 6)}" for name in question.free)
    return f" No route stays {side} {html.number(best.value, 8)}: {best.kind} at {place}."


def _survival(route: Route) -> str:
    """What is shown of errors."""
    found = route.survival
    if found is None:
        return ""
    shown = f" ({found.statement})" if found.proof is None else ""
    return f" Survives errors {found.errors!s}: {found.status}{shown}."


def _cost(route: Route) -> str:
    """What it was planned for, if that is not the length alone; rounding forgets other costs."""
    if not np.isfinite(route.cost) or (route.objective == "length" and not route.snaps):
        return ""
    priced = " with the price of the snaps" if route.snaps else ""
    return f", {route.objective}{priced} {html.number(route.cost)}"


class SampledRouteKind(Kind[Route]):
    """Routes by random trees of lifted edges, where no set can be computed."""

    table = "sampled_route"
    tasks = (plan_sampled,)
    natural = True
    own = MappingProxyType({"goal": (NaturalSection | None, None)})

    def check(self, section: Any) -> None:
        """It ends at a goal, or under loads; peaks need a set."""
        if isinstance(section.objective, str) and EXTREME.fullmatch(section.objective):
            raise requirement("give an objective without peak or least, which need a set")
        if section.goal is None and not section.loads:
            raise requirement("give a goal, or loads whose last values hold at the goal")

    def look_up_more(self, question: Question) -> None:
        """Refuse actuators among the loads."""
        section = question.section
        for i, leg in enumerate(section.loads):
            both = [name for name in leg if name in section.actuators]
            if both:
                raise InputError(
                    f"`{question.key}.loads[{i}]` must not move actuators; got {both[0]}."
                )

    def figures(self, question: Question, answer: Route) -> list[Figure]:
        """Parameters, shapes and margins."""
        return figures_of_way(None, question.files, answer, "route", question.within)

    def words(self, question: Question, answer: Route) -> str:
        """Say how it arrived."""
        margin, length = html.number(answer.margin), html.number(answer.length)
        return f"**arrived** without a snap, smallest margin {margin}, length {length}."


STANDINGS: Mapping[ProofStatus, tuple[str, str]] = {
    ProofStatus.PROVED: ("Proved", ""),
    ProofStatus.SUPPORTED: (
        "Supported by samples",
        " The second derivatives behind these bounds are estimated from samples, so this is "
        "evidence and no proof.",
    ),
}
"""What a page says first and last of a curve that keeps its bounds, by status."""


class VerifyKind(Kind[Verification]):
    """Whether a schedule can be executed without a snap, and whether that is proved."""

    table = "verify"
    tasks = (verify,)
    left_out = ("options", "structure")
    within_set = True

    def figures(self, question: Question, answer: Verification) -> list[Figure]:
        """As for a route."""
        status: Literal["arrived", "refused"] = "arrived" if answer.verified else "refused"
        return figures_of_way(
            question.eset, question.files, as_route(answer, status), "way", question.within
        )

    def words(self, question: Question, answer: Verification) -> str:
        """Say how near to instability it leads, and whether that is proved."""
        proof = "" if answer.proof is None else f", {answer.proof.status}"
        return f"**verified**, smallest margin {html.number(answer.margin)}{proof}."

    def details(self, question: Question, answer: Verification) -> list[str]:
        """What is known between the states."""
        return [_proof(answer.proof)] if answer.verified and answer.proof is not None else []

    def write_files(self, question: Question, answer: Verification, folder: Path) -> None:
        """Write the schedule, and the certificate of what is proved."""
        super().write_files(question, answer, folder)
        proof = answer.proof
        if proof is None or proof.status is not ProofStatus.PROVED:
            return
        if proof.states.structure.plain_energy() is not None:
            write_certificate(proof, folder / f"{question.files}-certificate.json")

    def refusal(self, question: Question, answer: Verification) -> str:
        """Reason why it cannot be executed."""
        return "" if answer.verified else f"{answer.why[:1].upper()}{answer.why[1:]}."


def _proof(proof: Proof) -> str:
    """What is known between the states, in words that its status bears."""
    if proof.status == ProofStatus.UNPROVED:
        return f"<p>Not proved: {escape(proof.why)}.</p>"
    head, rest = STANDINGS[proof.status]
    error = html.number(float(np.max(proof.error, initial=0.0)), 2)
    return (
        f"<p><strong>{head}</strong> on {len(proof.error)} segments: between the states, too, the "
        f"equilibrium exists, is the only one nearby and keeps a margin of "
        f"{html.number(proof.margin)}; it leaves the chords by {error} at most.{rest}</p>"
    )
