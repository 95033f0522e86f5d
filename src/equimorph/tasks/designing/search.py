"""The search for a better design: models of values, trust regions, full rebuilds."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from equimorph.tasks.designing.bundle import FEASIBLE, Bundle, DesignProblem, Judged, Lost
from equimorph.tasks.designing.family import Vector

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
    """The designs of a family under questions and bounds.

    Parameters
    ----------
    problem
        What is asked.
    most
        Rebuilds allowed.
    """

    problem: DesignProblem
    most: int
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
        values, value = (
            self.problem.family.values(new.x),
            self.problem.objectives[0].sign * new.level,
        )
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
