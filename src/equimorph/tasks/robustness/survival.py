"""`survival`: whether a schedule is executed without a snap under errors, by bounds or trials."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Parameters
from equimorph.equilibria import check_start
from equimorph.errors import InputError
from equimorph.model import Constraint, Schedule, names_of
from equimorph.structures import State
from equimorph.tasks.robustness.error_model import ErringStructure, Errors, Offsets, errors_of
from equimorph.tasks.robustness.evidence import Status, Survival
from equimorph.tasks.robustness.room import error_directions
from equimorph.tasks.robustness.trials import Execution, TrialEnds, corner_rows
from equimorph.tasks.route import describe_place
from equimorph.tasks.straight_lines import FINE
from equimorph.tasks.verification.evidence import ProofStatus
from equimorph.tasks.verification.schedule_check import follow_polyline
from equimorph.tasks.verification.tube import Tube, TubeProof

LIMITS = ("lower", "upper")
"""Ends of what values of a parameter may be."""
DOUBLINGS = 7
"""Doublings, or halvings, of the errors before a room counts as open, or as none."""
NEAR = 0.01
"""Relative width at which bisections of the size of errors end, of trials; proofs take more."""
NEAR_PROOF = 0.05


@check_arguments
def survival(
    start: State,
    schedule: Schedule | Sequence[Mapping[str, float]],
    survive: Mapping[str, float] | Errors,
    *,
    within: Sequence[Constraint] = (),
) -> Survival:
    """Decide whether structures with errors execute a schedule without a snap.

    Errors stay constant during the execution; they are there before it begins. A box of errors is
    divided, together with the schedule, into cells for each of which a Newton–Kantorovich bound
    shows one stable equilibrium for all of its points. Before, trials in its corners may refute it.
    Of normally distributed errors random trials tell the probability to survive.

    Parameters
    ----------
    start
        State of the perfect structure in which the schedule begins.
    schedule
        A schedule of the structure, or way-points.
    survive
        Half widths of a box by name, or `Errors`.
    within
        Constraints to obey.

    Returns
    -------
    What is shown, or what a trial met, and where.

    Raises
    ------
    InputError
        If the start is no stable equilibrium, or a name means no parameter and no data.
    """
    return Question.of(start, schedule, survive, within).answer()


@dataclass(frozen=True)
class SurvivalRoom:
    """The largest errors that a schedule survives, as multiples of given ones.

    Parameters
    ----------
    proved
        Largest multiple for which survival was proved or, by sampled bounds, supported; 0: none.
    survived
        Largest multiple for which all trials arrived: at most little above the true one.
    open
        Whether nothing was met up to the largest multiple that was tried.
    met
        What was met beyond.
    """

    proved: float
    survived: float
    open: bool
    met: str

    def __repr__(self) -> str:
        """Both multiples."""
        return f"SurvivalRoom(shown {self.proved:.4g}, survived {self.survived:.4g}: {self.met})"


@check_arguments
def survival_room(
    start: State,
    schedule: Schedule | Sequence[Mapping[str, float]],
    survive: Mapping[str, float] | Errors,
    *,
    within: Sequence[Constraint] = (),
) -> SurvivalRoom:
    """Find the widest box of errors that a schedule survives, by bounds and by bisected trials.

    Parameters
    ----------
    start
        State of the perfect structure in which the schedule begins.
    schedule
        A schedule of the structure, or way-points.
    survive
        Half widths of the box by name; it is scaled as a whole.
    within
        Constraints to obey.

    Returns
    -------
    The largest multiples of the box, to 1 % (trials) and 5 % (bounds).

    Raises
    ------
    InputError
        As for `survival`, or for errors with a probability.
    """
    asked = Question.of(start, schedule, survive, within)
    if asked.errors.probability is not None:
        raise InputError(f"`survive` must be a box, without a probability; got {asked.errors!r}.")
    survived, is_open = asked.room()
    proved = survived if survived > 0.0 and asked.proves(survived) else 0.0
    if survived > 0.0 and proved == 0.0:
        proved = _bisect(0.0, survived, asked.proves, NEAR_PROOF)
    beyond = asked.scaled((1.0 + NEAR) * survived if survived > 0.0 else 1.0)
    return SurvivalRoom(proved, survived, is_open, beyond.refutation(beyond.try_box()))


def trial_room(
    start: State, schedule: Schedule, errors: Errors, within: Sequence[Constraint]
) -> float:
    """Largest multiple of a box of errors for which all trials of a schedule arrive."""
    return Question.of(start, schedule, errors, within).room()[0]


def rest_survives(
    state: State, survive: Mapping[str, float] | Errors, within: Sequence[Constraint]
) -> Survival:
    """Whether a state that rests survives errors: refuted by trials, else taken to do so."""
    erring = ErringStructure(state.structure, errors_of(survive))
    return Question(state, np.zeros((0, len(state.p))), erring, tuple(within)).answer_by_trials()


@dataclass(frozen=True)
class Question:
    """A schedule, and the errors that it has to survive."""

    start: State
    rows: Parameters
    erring: ErringStructure
    within: tuple[Constraint, ...]

    @classmethod
    def of(
        cls,
        start: State,
        schedule: Schedule | Sequence[Mapping[str, float]],
        survive: Mapping[str, float] | Errors,
        within: Sequence[Constraint],
    ) -> "Question":
        """Check what a caller asks."""
        check_start(start)
        if not start.stable:
            raise InputError(f"`start` must be stable; got a state of index {start.index}.")
        erring = ErringStructure(start.structure, errors_of(survive))
        return cls(start, corner_rows(start, schedule), erring, tuple(within))

    @property
    def errors(self) -> Errors:
        """The errors."""
        return self.erring.errors

    def scaled(self, factor: float) -> "Question":
        """The same with larger or smaller errors."""
        erring = ErringStructure(self.start.structure, self.errors.scaled(factor))
        return Question(self.start, self.rows, erring, self.within)

    def answer(self) -> Survival:
        """Answer by trials, or by trials and a proof."""
        found = self.answer_by_trials()
        if self.errors.probability is not None or not found.survives:
            return found
        proof = self.prove()
        statuses: dict[ProofStatus, Status] = {
            ProofStatus.PROVED: "proved",
            ProofStatus.SUPPORTED: "supported",
            ProofStatus.UNPROVED: "unproved",
        }
        place = "" if proof.failed is None else f", near {proof.failed.parameters}"
        why = f"{proof.why}{place}" if proof.why else ""
        return replace(found, status=statuses[proof.status], why=why, proof=proof)

    def answer_by_trials(self) -> Survival:
        """Answer by trials alone."""
        if self.errors.probability is not None:
            return self._probable(self.errors.probability)
        offsets = self._box()
        ends = self.execute(offsets)
        why = self.refutation(ends)
        status: Status = "refuted" if why else "supported"
        return Survival(status, why, self.errors, offsets, ends.kind, ends.at)

    def _probable(self, asked: float) -> Survival:
        offsets = self.errors.random()
        ends = self.execute(offsets)
        found = Survival("probable", "", self.errors, offsets, ends.kind, ends.at)
        if found.probability >= asked:
            return found
        status: Status = "refuted" if found.most_probable < asked else "unproved"
        more = "" if status == "refuted" else "; more trials may show it"
        first = self.refutation(ends)
        why = f"{found.statement}, not {asked:g}{more}. {first}".rstrip(". ")
        return Survival(status, why, self.errors, offsets, ends.kind, ends.at)

    def _box(self) -> Offsets:
        """Corners, middles of sides, and random points on the sides of the box."""
        count = len(self.errors.sizes)
        rays = error_directions(count, np.random.default_rng(self.errors.seed))
        if self.erring.data:  # each of their values needs a structure of its own
            rays = rays[: 2 * count + 2**count]
        return np.asarray(rays / np.abs(rays).max(axis=1, keepdims=True) * self.errors.widths)

    def try_box(self) -> TrialEnds:
        """Ends of the trials on the sides of the box."""
        return self.execute(self._box())

    def execute(self, offsets: Offsets) -> TrialEnds:
        """Trials with some errors, those with the same data side by side."""
        shifts, shares = self.erring.shifts(offsets), self.erring.shares(offsets)
        z = np.tile(self.start.z, (len(offsets), 1))
        nowhere = (np.zeros(len(offsets)), z, self.start.p + shifts)
        ends = TrialEnds(np.full(len(offsets), "start", dtype="<U24"), *nowhere)
        outside = self._leave_meaning(shifts)
        ends.kind[outside] = "limit"
        different, group = np.unique(shares, axis=0, return_inverse=True)
        for number, row in enumerate(different.tolist()):
            lanes = np.flatnonzero((group.ravel() == number) & ~outside)
            start = self.erring.carry(self.start, row) if len(lanes) else None
            if start is not None:
                within = self.erring.constraints(self.within, start.structure)
                done = Execution(start, self.rows, within).of_all(shifts[lanes])
                ends = ends.with_rows(lanes, done)
        return ends

    def _leave_meaning(self, shifts: Parameters) -> Flags:
        """Whether parameters leave the limits of their meaning somewhere on the way."""
        parameters = self.start.structure.parameters
        low, high = (np.array([getattr(each, end) for each in parameters]) for end in LIMITS)
        rows = np.concatenate([self.start.p[None], self.rows])
        least, most = rows.min(axis=0) + shifts, rows.max(axis=0) + shifts
        return np.asarray(((least <= low) | (most >= high)).any(axis=1))

    def refutation(self, ends: TrialEnds) -> str:
        """What the first of the trials that failed met, and where; empty if all arrived."""
        failed = np.flatnonzero(ends.kind != "arrived")
        if len(failed) == 0:
            return ""
        offsets = self._box() if self.errors.probability is None else self.errors.random()
        first = failed[np.argmin(ends.at[failed])]
        pairs = zip(self.errors.sizes, offsets[first].tolist(), strict=True)
        with_errors = ", ".join(f"{name} {value:+.4g}" for name, value in pairs)
        here = State(self.start.structure, ends.z[first], ends.p[first])
        moving = np.ptp(np.concatenate([self.start.p[None], self.rows]), axis=0) > 0.0
        names = np.array(names_of(here.structure.parameters))[moving].tolist()
        place, met = describe_place(here, names), str(ends.kind[first])
        if met == "limit":
            return f"with the errors {with_errors} a parameter leaves the limits of its meaning"
        if met == "start":
            return f"with the errors {with_errors} stability is lost before it begins"
        return f"with the errors {with_errors} it meets a {met} at {place}"

    def prove(self) -> TubeProof:
        """Proof for all errors of the box."""
        deviations = self.erring.deviations
        done = follow_polyline(self.start, self.rows, self.within, FINE)
        if deviations is None:
            why = f"F is not linear in a measure of {' and '.join(self.erring.data)}"
            return TubeProof(why, 0, "unknown")
        if done.end.kind != "arrived":
            return TubeProof(f"without errors it meets a {done.end.kind}", 0, "unknown")
        changed = tuple(self.erring.constraints(self.within, each.changed) for each in deviations)
        return Tube(done.states, self.erring.steps, deviations, self.within, changed).prove()

    def arrives(self, factor: float) -> bool:
        """Whether all trials do with errors so much larger."""
        return bool((self.scaled(factor).try_box().kind == "arrived").all())

    def proves(self, factor: float) -> bool:
        """Whether survival is proved, or supported, with errors so much larger."""
        return self.scaled(factor).prove().status != ProofStatus.UNPROVED

    def room(self) -> tuple[float, bool]:
        """Largest multiple of the errors that trials survive; whether nothing was met beyond."""
        low, high = self._bracket()
        survived = low if high is None else _bisect(low, high, self.arrives, NEAR)
        return survived, high is None

    def _bracket(self) -> tuple[float, float | None]:
        """Multiples of the errors that do and do not survive trials; None if all do."""
        factor, grows = 1.0, self.arrives(1.0)
        for _ in range(DOUBLINGS):
            new = 2.0 * factor if grows else 0.5 * factor
            if not self._means(new):
                return factor, None
            if self.arrives(new) != grows:
                return (factor, new) if grows else (new, factor)
            factor = new
        return (factor, None) if grows else (0.0, factor)

    def _means(self, factor: float) -> bool:
        """Whether errors so much larger leave data and parameters their meaning."""
        return all(factor * float(self.errors.sizes[name]) < 1.0 for name in self.erring.data)


def _bisect(low: float, high: float, good: Callable[[float], bool], near: float) -> float:
    """Largest factor that is good, between one that is (or 0) and one that is not."""
    least = near * high
    while high - low > max(near * high, least):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if good(middle) else (low, middle)
    return low
