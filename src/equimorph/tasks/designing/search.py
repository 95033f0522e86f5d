"""The search for a better design: models of values, trust regions, full rebuilds.

A bundle holds values of the design's question as functions of the variables, made smaller by SLSQP.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np
from scipy.optimize import minimize

from equimorph.arrays import Float
from equimorph.tasks.designing.bounds import Asked, DesignBound, Numbers, VariableBounds
from equimorph.tasks.designing.family import DesignFamily, Vector
from equimorph.tasks.designing.pieces import Piece, follow_piece
from equimorph.tasks.designing.questions import Answer

FAR = 3.0
"""Factor on the slopes of bounds by which those are told that may be met in a trust region."""
PENALTY = 1e3
"""Of the largest excess over bounds."""
FEASIBLE = 1e-6
"""Excess over bounds, relative to their size, that is none; larger ones are made smaller first."""
STEPS = 30
"""Steps of SLSQP within one trust region."""


@dataclass(frozen=True)
class DesignProblem:
    """A family, what is asked about its structures, and bounds."""

    family: DesignFamily
    """The structures."""
    objectives: tuple[Asked, ...]
    within: tuple[DesignBound, ...]
    """Questions of which the worst one is made better, and bounds."""
    tolerance: float
    """Relative change of the value that counts as none."""

    @property
    def questions(self) -> list[tuple[Asked, DesignBound | None]]:
        """The objectives, then the questions that are bounded, with their bounds."""
        bounded = [(each.question, each) for each in self.within if each.question is not None]
        return [*((each, None) for each in self.objectives), *bounded]

    @property
    def plain(self) -> VariableBounds:
        """Bounds on functions of the variables."""
        own = tuple(each for each in self.within if each.question is None)
        return VariableBounds(self.family, own)


@dataclass(frozen=True)
class Judged:
    """A design with the answers to all questions, the objective first."""

    x: Vector
    answers: tuple[Answer, ...]
    level: float
    violation: float

    @property
    def why(self) -> str:
        """Why a question has no answer; empty if all have one."""
        return next((each.why for each in self.answers if each.why), "")


class Lost(Exception):  # noqa: N818  # names what happened, to SLSQP alone
    """A piece was not found again at trial variables."""


@dataclass(frozen=True)
class Bounded:
    """A piece whose values must not exceed a level; where it is known, and the level's size."""

    x: Vector
    piece: Piece
    level: float
    size: float

    def excess(self, piece: Piece) -> float:
        """By how much it exceeds the level at some variables."""
        return float((piece.values.max() - self.level) / self.size)


class Bundle:
    """Values near a design as functions of the variables: those of its pieces, and of others'."""

    def __init__(self, problem: DesignProblem, base: Judged, extra: Sequence[Judged]) -> None:
        """Collect pieces, each with the variables where it is known."""
        self.problem, self.base, self.x = problem, base, base.x
        self.objective, self.bounded = list[tuple[Vector, Piece]](), list[Bounded]()
        for each in (base, *extra):
            for (_, bound), answer in zip(problem.questions, each.answers, strict=True):
                # states with given parameters are the same ones for all designs
                pieces = [p for p in answer.pieces if each is base or len(p.free)]
                if each is base:
                    self.bounded += [Bounded(each.x, piece, 0.0, 1.0) for piece in answer.bounds]
                if bound is None:
                    self.objective += [(each.x, piece) for piece in pieces]
                else:
                    self.bounded += [Bounded(each.x, p, bound.level, bound.size) for p in pieces]
        self.scale = max(abs(base.level), 1e-12)
        self._pieces: dict[int, list[tuple[Vector, Piece]]] = {}

    def near_bounds(self, trust: float) -> "list[Bounded]":
        """Bounds that may be met within a trust region, by their slopes."""
        family, kept = self.problem.family, []
        for each in self.bounded:
            here = self._at(each.x, each.piece, self.x)
            rise = np.abs(here.slopes(family, self.x)).sum(axis=1) * trust
            if ((here.values - each.level + FAR * rise) / each.size).max() > 0.0:
                kept.append(each)
        return kept

    def lower(self, trust: float) -> Vector:
        """Variables with the least largest value within the trust region, by SLSQP.

        While bounds are violated, with the least violation.
        """
        x, k, plain = self.x, len(self.x), self.problem.plain
        low, high = np.maximum(0.0, x - trust), np.minimum(1.0, x + trust)
        self.kept = self.near_bounds(trust)
        constraints = [{"type": "ineq", "fun": self._rows, "jac": self._row_slopes}]
        for kind, function in (("eq", plain.equal), ("ineq", plain.above)):
            if len(function(x)):
                constraints.append(_on_variables(kind, function, plain))
        slack = max(self.excess(x), 0.0)
        self.restoring = slack > FEASIBLE
        if not (self.objective or self.restoring):
            return x
        start = np.concatenate([x, [self.level(x) / self.scale, slack]])
        goal = np.append(np.zeros(k), [0.0, 1.0] if self.restoring else [1.0, PENALTY])
        found = minimize(
            lambda y: goal @ y, start, jac=lambda _: goal, method="SLSQP",
            constraints=constraints,
            bounds=[*zip(low, high, strict=True), (None, None), (0.0, slack)],
            options={"maxiter": STEPS, "ftol": 0.1 * self.problem.tolerance},
        )  # fmt: skip
        return np.asarray(np.clip(found.x[:k], low, high))

    def excess(self, x: Vector) -> float:
        """Largest excess of bounded pieces over their levels, relative to the size of these."""
        found = [b.excess(self._at(b.x, b.piece, x)) for b in self.kept]
        return max(found, default=-np.inf)

    def level(self, x: Vector) -> float:
        """Largest value of the objective's pieces."""
        values = [each.values.max() for each in self.objective_at(x)]
        return float(max(values, default=self.base.level))

    def objective_at(self, x: Vector) -> list[Piece]:
        """The objective's pieces at some variables."""
        return [self._at(*each, x) for each in self.objective]

    def still_counts(self, old: Judged, new: Judged) -> bool:
        """Whether values of an earlier design are not contradicted by a rebuilt one."""
        room = self.problem.tolerance * self.scale
        for answer in old.answers[: len(self.problem.objectives)]:
            for piece in answer.pieces:
                if len(piece.free) == 0:
                    continue
                there = follow_piece(piece, self.problem.family, old.x, new.x)
                if there is None or there.values.max() > new.level + room:
                    return False
        return True

    def _at(self, start: Vector, piece: Piece, x: Vector) -> Piece:
        """A piece at some variables, followed from the nearest ones where it is known already."""
        near = self._pieces.setdefault(id(piece), [(start, piece)])
        at, there = min(near, key=lambda each: float(np.abs(each[0] - x).max()))
        if not np.array_equal(at, x):
            found = follow_piece(there, self.problem.family, at, x)
            if found is None:
                raise Lost(piece.kind)
            near.append((x, found))
            return found
        return there

    def _all_at(self, y: Vector) -> list[tuple[Piece, float, float, bool]]:
        """Pieces with the levels and sizes of their rows, and whether the objective bounds them."""
        x, level, slack = y[:-2].copy(), y[-2], y[-1]
        counting = [] if self.restoring else self.objective_at(x)
        rows = [(piece, level * self.scale, self.scale, True) for piece in counting]
        bounded = [
            (self._at(b.x, b.piece, x), b.level + slack * b.size, b.size, False) for b in self.kept
        ]
        return rows + bounded

    def _rows(self, y: Vector) -> Numbers:
        rows = [(level - piece.values) / size for piece, level, size, _ in self._all_at(y)]
        return np.concatenate(rows)

    def _row_slopes(self, y: Vector) -> Float[np.ndarray, "m k"]:
        x, parts = y[:-2].copy(), []
        for piece, _, size, own in self._all_at(y):
            slopes = -piece.slopes(self.problem.family, x) / size
            last = np.tile([1.0, 0.0] if own else [0.0, 1.0], (len(slopes), 1))
            parts.append(np.concatenate([slopes, last], axis=1))
        return np.concatenate(parts)


def _on_variables(
    kind: str, function: Callable[[Vector], Vector], plain: VariableBounds
) -> dict[str, Any]:
    def slopes(y: Vector) -> Float[np.ndarray, "m k"]:
        own = plain.slopes(function, y[:-2])
        return np.concatenate([own, np.zeros((len(own), 2))], axis=1)

    return {"type": kind, "fun": lambda y: function(y[:-2]), "jac": slopes}


TRUST, LARGEST, SMALLEST = 0.2, 0.5, 1e-4
"""First, largest and smallest size of the trust region, relative to the ranges of the variables."""
WIDE = 0.05
"""Size of the trust region beyond which no gain in it means an optimum."""
SHARE = 0.1
"""Share of the predicted gain that a rebuilt design must have to be accepted."""
OTHERS = 3
"""Other designs whose events are kept in sight, the last ones."""
KEPT = 0.99
"""Share of a violation that must remain, to first order, where nothing nearby obeys bounds."""
ACTIVE = 1e-3
"""Relative distance from the largest value up to which pieces are reported as active."""

DesignStatus = Literal["found", "stalled", "infeasible", "undefined start", "budget spent"]


@dataclass(frozen=True)
class DesignStep:
    """An accepted design: its variables, value and largest violation; sets built up to it."""

    variables: Mapping[str, Any]
    value: float
    violation: float
    rebuilds: int


@dataclass
class DesignSearch:
    """The designs of a family under questions and bounds."""

    problem: DesignProblem
    """What is asked."""
    most: int
    """Rebuilds allowed."""
    rebuilds: int = 0
    history: list[DesignStep] = field(default_factory=list)
    trust: float = TRUST
    why: str = "rebuilt designs gain less than the gradients promise"
    extra: list[Judged] = field(default_factory=list)
    """Other designs whose values count nearby, too."""

    def judge(self, x: Vector, near: Judged | None) -> Judged:
        """Full answers to all questions."""
        self.rebuilds += 1
        problem = self.problem
        structure = problem.family.structure(x)
        answers = []
        for k, (question, _) in enumerate(problem.questions):
            states = () if near is None else near.answers[k].near
            answers.append(question.answer(structure, states))
            if answers[-1].why:
                return Judged(x, tuple(answers), np.inf, np.inf)
        every = list(zip(problem.questions, answers, strict=True))
        level = max(q.sign * a.value for (q, bound), a in every if bound is None)
        rows = [b.excess(q.sign * a.value) for (q, b), a in every if b is not None]
        rows += [piece.values.max() for answer in answers for piece in answer.bounds]
        violation = max(problem.plain.violation(x), *rows, 0.0)
        return Judged(x, tuple(answers), level, violation)

    def run(self, x: Vector, near: Judged | None = None) -> tuple[Judged, DesignStatus, str]:
        """Accept better designs until there is none, to first order, within the trust region."""
        base = self.judge(x, near)
        if base.why:
            return base, "undefined start", base.why
        self._accept(base)
        while self.trust >= SMALLEST and self.rebuilds < self.most:
            model = Bundle(self.problem, base, self.extra)
            try:
                trial = model.lower(self.trust)
            except Lost as lost:
                self.why = f"a value was lost on the way to better ones: {lost}"
                self.trust *= 0.5
                continue
            gain = base.level - model.level(trial)
            if base.violation <= FEASIBLE and gain <= self._nothing(base):
                return base, "found", ""
            if max(model.excess(trial), self.problem.plain.violation(trial)) > self._least(base):
                self.why = "no design nearby violates them less"
                break
            base = self._try(model, base, trial, gain)
        if base.violation > FEASIBLE:
            why = f"bounds are violated by {base.violation:.3g}; {self.why}"
            return base, "infeasible", why
        if self.trust >= SMALLEST:
            return base, "budget spent", f"{self.most} designs were rebuilt"
        return base, "stalled", self.why

    def _least(self, base: Judged) -> float:
        """Violation of a trial design beyond which none nearby is better; ∞ if none is violated."""
        return KEPT * base.violation if base.violation > FEASIBLE else np.inf

    def _nothing(self, base: Judged) -> float:
        """Gain that is none, less in small trust regions."""
        size = max(abs(base.level), 1e-12)
        return self.problem.tolerance * size * min(1.0, self.trust / WIDE)

    def _try(self, model: Bundle, base: Judged, trial: Vector, gain: float) -> Judged:
        """Rebuild a design; the next one to start from."""
        new = self.judge(trial, base)
        if self._better(new, base, gain):
            known = (base, *self.extra)[:OTHERS]
            self.extra = [each for each in known if model.still_counts(each, new)]
            self.trust = min(2.0 * self.trust, LARGEST)
            self._accept(new)
            return new
        self.trust *= 0.5
        if new.why:
            self.why = new.why
        else:
            self.extra = [new, *self.extra][:OTHERS]
        return base

    def _better(self, new: Judged, base: Judged, gain: float) -> bool:
        if new.why:
            return False
        if base.violation > FEASIBLE:
            return new.violation <= max(FEASIBLE, 0.9 * base.violation)
        return new.violation <= FEASIBLE and new.level < base.level - SHARE * gain

    def _accept(self, new: Judged) -> None:
        values = self.problem.family.values(new.x)
        value = self.problem.objectives[0].sign * new.level
        self.history.append(DesignStep(values, value, new.violation, self.rebuilds))

    def active(self, last: Judged) -> tuple[str, ...]:
        """States that have the value, among them ones known from earlier designs; bounds met."""
        if last.why:
            return ()
        model = Bundle(self.problem, last, self.extra)
        near = last.level - ACTIVE * abs(last.level)
        kinds = [each.kind for each in model.objective_at(last.x) if each.values.max() >= near]
        met = [each.piece.kind for each in model.bounded if each.excess(each.piece) >= -ACTIVE]
        return tuple(dict.fromkeys([*kinds, *met]))
