"""`replay`: a schedule in time, in a simulator that knows nothing of equilibrium sets."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Annotated, Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.argument_kinds import one_of
from equimorph.argument_vocabulary import POSITIVE
from equimorph.arrays import Float
from equimorph.dynamics.model import Course, Model, Plant, landing
from equimorph.dynamics.motion import TimedCorners, equilibria_along, timed_corners
from equimorph.dynamics.simulators import model_of
from equimorph.model import Schedule
from equimorph.structures import State, Structure
from equimorph.tolerances import DEPARTURE

SAMPLES = 100
"""Times at which a replay is compared with the statics."""
FINE_SAMPLES = 10
"""Times in each of these at which it is asked whether it has left."""
STILL = 1e-6
"""Speed below which the structure rests, in units of T."""
LONGEST_HOLD = 20.0
"""How often the hold is prolonged while the structure still moves."""
ALIKE = 0.1
"""Share of the deviation by which half the step may change it in a converged replay."""
PART_OF_SNAP = 0.75
"""Share of the distance to where it comes to rest at which a motion has left the branch."""
SAME_REST = 1e-4
"""Distance of two equilibria, relative to the structure's size, that are the same."""
SETTLING = 1.0
"""Time, in units of T, for which it is held at first at a time: it starts in an equilibrium of its
own, but for the softness of closures."""
NEGLIGIBLE = 1e-5
"""Change of the deviation, relative to the structure's size, that is none."""

Simulator = Annotated[Literal["mujoco", "pyelastica", "own"], one_of("mujoco", "pyelastica", "own")]
Convergence = Literal["converged", "not converged", "not checked"]


@dataclass(frozen=True, eq=False)
class Replay:
    """What a structure did when its schedule was played in time.

    Deviations are the largest distance of a point from where it should be, in the unit of length.
    Before a snap they are the sum of two parts at most: that of the chain of links, which more
    links reduce, and that of the motion, which a lower speed reduces.

    Parameters
    ----------
    start
        Equilibrium of the library at the beginning.
    simulator
        Which one; "own" is not independent of the library.
    times
        Times of the samples, from 0 on, in the schedule's unit; the last one is after the hold.
    parameters
        All parameters at these times.
    points
        Places of the structure's points.
    statics
        Where they are in the equilibria of `lift`; nan where these have ended.
    chain
        Number of points that are joined to a line each, in order.
    deviation
        From the equilibria of `lift`; nan where these have ended.
    discretisation, dynamics
        Its two parts: equilibria of the chain from those of `lift`, motion from those of the chain.
    snapped
        Whether the structure is away from the static branch after the hold.
    where
        Time at which it left the branch for good; None if it did not.
    fold
        Time at which the chain's own equilibria end; None if they do not.
    lateness
        Time from there to `where`.
    expected_lateness
        What the normal form of the fold predicts for it; see docs/time.md.
    landed_in
        Stable state of the library where it came to rest after a snap; None without one.
    closure
        Largest violation of a constraint, in the unit of length.
    energy
        Potential and kinetic energy at the times, in the structure's unit.
    converged
        "converged" if half the step in time changes the deviation little, twice the duration does
        not raise it, and all tell the same snap; "not checked" if that was not asked for.
    """

    start: State
    simulator: str
    times: Float[np.ndarray, " times"]
    parameters: Float[np.ndarray, "times parameters"]
    points: Float[np.ndarray, "times points space"]
    statics: Float[np.ndarray, "times points space"]
    chain: int
    deviation: Float[np.ndarray, " times"]
    discretisation: Float[np.ndarray, " times"]
    dynamics: Float[np.ndarray, " times"]
    snapped: bool
    where: float | None
    fold: float | None
    lateness: float
    expected_lateness: float
    landed_in: State | None
    closure: float
    energy: Float[np.ndarray, " times"]
    converged: Convergence = "not checked"

    def __repr__(self) -> str:
        """Duration, largest deviation, and whether it snapped."""
        end = "no snap"
        if self.snapped:
            end = f"snapped at {self.where:.4g}" if self.where is not None else "snapped"
        checked = "" if self.converged == "not checked" else f", {self.converged}"
        return (
            f"Replay({self.simulator}: {self.times[-1]:.4g} long, deviation "
            f"{self.largest_deviation:.3g}, {end}{checked})"
        )

    @property
    def largest_deviation(self) -> float:
        """Largest deviation where there are equilibria of `lift`."""
        return float(np.nanmax(self.deviation))

    @property
    def structure(self) -> Structure:
        """The structure."""
        return self.start.structure

    @property
    def independent(self) -> bool:
        """Whether the simulator has equations of its own."""
        return self.simulator != "own"


@check_arguments
@dataclass(frozen=True)
class ReplaySettings:
    """How a replay is computed.

    Parameters
    ----------
    links
        Links of each member of a chain.
    step
        Step in time, in units of T.
    damping
        Damping of elastic joints over their stiffness, in units of T.
    hold
        Time for which the last parameters are held, in units of T; longer while it still moves.
    """

    links: int = 40
    step: Annotated[float, POSITIVE] = 0.02
    damping: float = 0.05
    hold: float = 20.0


@check_arguments
def replay(
    schedule: Schedule | Sequence[Mapping[str, float]] | Mapping[str, float],
    start: State | None = None,
    *,
    simulator: Simulator = "mujoco",
    rate: float | None = None,
    duration: float | None = None,
    structure: Structure | None = None,
    settings: ReplaySettings | None = None,
    check: bool = False,
) -> Replay:
    """Play a schedule in time in a simulator, and compare with the equilibria that it promises.

    MuJoCo [Todorov2012]_ gets the structure as chains of rigid links with elastic, damped joints,
    and nothing else from this library. A replay without a snap does not prove that a lower speed is
    safe: at a finite rate a structure passes a fold and snaps later; `snap_in_time` holds it.

    Parameters
    ----------
    schedule
        A schedule, or way-points that are met at straight lines from the start.
    start
        State to start in; by default that of the schedule.
    simulator
        "mujoco"; "pyelastica", in which rods that are clamped at both ends stretch and shear; or
        "own": the structure's own equations of motion, which are not independent.
    rate
        Speed in the scaled parameters, per unit of time: radians for angles; for schedules without
        times, or instead of these.
    duration
        Time of the whole instead of a rate.
    structure
        Structure of a schedule that carries none.
    settings
        Links, step, damping and hold.
    check
        Whether to replay again with half the step and twice the duration; see `Replay.converged`.

    Returns
    -------
    Shapes and deviations over time, and what happened.

    Raises
    ------
    InputError
        Without start or times, for a structure that the simulator does not cover (by name), or if
        the simulator is not installed.

    Examples
    --------
    ``em.replay(route.schedule, rate=0.02)``
    """
    begin, motion = timed_corners(schedule, start, structure, rate, duration)
    used = settings or ReplaySettings()
    model = model_of(begin, simulator, used.links)
    first = _run(model, begin, motion, used)
    if not check:
        return first
    finer = _run(model, begin, motion, replace(used, step=0.5 * used.step))
    slower = _run(model, begin, motion.slower(2.0), used)
    return replace(first, converged=_convergence(first, finer, slower))


def _convergence(first: Replay, finer: Replay, slower: Replay) -> Convergence:
    size = _size(first.points[0])
    change = abs(first.largest_deviation - finer.largest_deviation)
    same = first.snapped == finer.snapped == slower.snapped
    close = change <= ALIKE * first.largest_deviation + NEGLIGIBLE * size
    falls = slower.largest_deviation <= first.largest_deviation + NEGLIGIBLE * size
    # beyond a snap the deviation is that of another state, whatever the step
    return "converged" if same and (first.snapped or (close and falls)) else "not converged"


def _size(points: Float[np.ndarray, "points space"]) -> float:
    return float(np.ptp(points, axis=0).max())


@dataclass
class _Record:
    """What is kept of a plant: where it is often, the rest at each sample."""

    times: list[float]
    places: list[np.ndarray]
    samples: list[int]
    energy: list[float]
    closure: float = 0.0

    def take(self, time: float, plant: Plant, sample: bool) -> None:
        """Add where it is, and what belongs to a sample."""
        if sample:
            self.samples.append(len(self.times))
            self.energy.append(plant.energy)
            self.closure = max(self.closure, plant.closure)
        self.times.append(time)
        self.places.append(plant.place)


def _run(model: Model, begin: State, motion: TimedCorners, used: ReplaySettings) -> Replay:
    """One replay: at rest, the motion, and a hold at its end."""
    step = used.step * model.unit
    count = max(1, int(np.ceil(motion.duration / step - 1e-9)))
    often = max(1, count // (SAMPLES * FINE_SAMPLES))
    every = often * max(1, count // (SAMPLES * often))
    plant, record = model.plant(begin, used.step, used.damping), _Record([], [], [], [])
    hold(plant, replace(used, hold=SETTLING))
    record.take(0.0, plant, True)
    for k, row in enumerate(motion.at(step * np.arange(1, count + 1)), 1):
        plant.set(row)
        plant.step()
        sample = k % every == 0 or k == count
        if sample or k % often == 0:
            record.take(k * step, plant, sample)
    held = step * hold(plant, used)
    record.take(count * step + held, plant, True)
    return _judge(model, begin, motion, plant, record, used)


def hold(plant: Plant, used: ReplaySettings, still: float = STILL) -> int:
    """Let the plant move at constant parameters until it rests; number of steps."""
    once = max(1, round(used.hold / used.step))
    done = 0
    while done == 0 or (plant.speed > still and done < LONGEST_HOLD * once):
        for _ in range(once):
            plant.step()
        done += once
    return done


def _judge(
    model: Model, begin: State, motion: TimedCorners, plant: Plant, record: _Record,
    used: ReplaySettings,
) -> Replay:  # fmt: skip
    """Compare a replay with the equilibria of the library and of the chain."""
    fine, samples = np.array(record.times), np.array(record.samples)
    times = fine[samples]
    points = np.array([plant.points_at(record.places[k]) for k in samples])
    rows = motion.at(times)
    # the statics meet the corners between samples, too
    corners = np.union1d(times, motion.times)
    sampled = np.searchsorted(corners, times)
    reference = equilibria_along(model, begin, motion.at(corners)).points[sampled]
    course = model.statics(begin, motion.at, corners, used.damping)
    size = _size(points[0])
    last = float(_away(times, points, corners, course)[-1])
    fold = course.fold
    # at rest where the branch has no equilibrium, it is on another one, however near
    gone = _is_fold(fold) or last > DEPARTURE * size or _elsewhere(plant, course, size)
    departure, where = PART_OF_SNAP * last, None
    if gone:
        everywhere = np.array([plant.points_at(each) for each in record.places])
        where = _departure(fine, _away(fine, everywhere, corners, course) > departure)
    expected = course.delay.lateness(departure) if course.delay and gone else float("nan")
    landed = landing(begin.structure, plant.guess(), rows[-1]) if gone else None
    late = float("nan") if where is None or fold is None else where - fold
    return Replay(
        begin, model.simulator, times, rows, points, reference,
        model.chain or points.shape[1],
        _largest(points - reference), _largest(course.points[sampled] - reference),
        _largest(points - course.points[sampled]), gone, where, fold, late, expected, landed,
        record.closure, np.array(record.energy),
    )  # fmt: skip


def _is_fold(fold: float | None) -> bool:
    return fold is not None and bool(np.isfinite(fold))


def _largest(gaps: Float[np.ndarray, "times points space"]) -> Float[np.ndarray, " times"]:
    return np.asarray(np.linalg.norm(gaps, axis=2).max(axis=1))


def _away(
    fine: Float[np.ndarray, " fine"],
    points: Float[np.ndarray, "fine points space"],
    times: Float[np.ndarray, " samples"],
    course: Course,
) -> Float[np.ndarray, " fine"]:
    """Distance from the static branch; after its end from where it ended."""
    branch = course.points
    if course.last is not None:
        branch = np.where(np.isnan(branch[:, :1, :1]), course.last, branch)
    after = np.clip(np.searchsorted(times, fine, side="right"), 1, len(times) - 1)
    share = (fine - times[after - 1]) / (times[after] - times[after - 1])
    between = branch[after - 1] + share[:, None, None] * (branch[after] - branch[after - 1])
    return _largest(points - between)


def _elsewhere(plant: Plant, course: Course, size: float) -> bool:
    """Whether the plant came to rest at another equilibrium than the branch's last one."""
    if course.fold is not None:
        return False
    settled = plant.equilibrium()
    return settled is not None and bool(
        _largest((settled - course.points[-1])[None])[0] > SAME_REST * size
    )


def _departure(times: Float[np.ndarray, " times"], left: np.ndarray) -> float:
    """Time from which on it is away for good."""
    near = np.flatnonzero(~left)
    return float(times[min(near[-1] + 1, len(times) - 1)]) if len(near) else float(times[0])
