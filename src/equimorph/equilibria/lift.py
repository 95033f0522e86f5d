"""`lift`: follow curves in parameter space from known equilibria, on the equilibrium set."""

from collections.abc import Sequence
from dataclasses import replace
from typing import overload

from equimorph.argument_checks import check_arguments
from equimorph.equilibria.legs import Leg, check_start, check_starts, way_points
from equimorph.equilibria.lifts import Lifts, lift_many
from equimorph.equilibria.paths import Event, Path, lift_one
from equimorph.equilibria.trace_options import TraceOptions
from equimorph.model import Constraint, Progress
from equimorph.structures import State, States

__all__ = ["Event", "Lifts", "Path", "check_start", "lift", "way_points"]


@overload
def lift(
    state: State,
    to: Leg | Sequence[Leg],
    *,
    within: Sequence[Constraint] = (),
    through_folds: bool = False,
    options: TraceOptions | None = None,
    progress: Progress | None = None,
) -> Path: ...
@overload
def lift(
    state: States,
    to: Leg | Sequence[Leg],
    *,
    within: Sequence[Constraint] = (),
    through_folds: bool = False,
    options: TraceOptions | None = None,
    progress: Progress | None = None,
) -> Lifts: ...
@check_arguments
def lift(
    state: State | States,
    to: Leg | Sequence[Leg],
    *,
    within: Sequence[Constraint] = (),
    through_folds: bool = False,
    options: TraceOptions | None = None,
    progress: Progress | None = None,
) -> Path | Lifts:
    """Follow curves from one state, or from each of many, on the equilibrium set.

    Error-controlled predictor–corrector in pseudo-arclength; folds and constraints by root finding
    on the curve, branch points by minimally augmented systems. Without `through_folds` a lift ends
    at the first event, as a quasi-static motion would. Many states are lifted side by side on all
    processors; the result of each is the same, bit for bit, independent of the other lanes and
    their order.

    Parameters
    ----------
    state
        Equilibrium from which to start, or `States` (lanes).
    to
        One leg, or several that are followed in turn. A leg is

        * a way-point ``{name: value}``, approached on a straight line; parameters that are not
          named keep their values;
        * a smooth curve: a function of t from 0 to 1 that returns such a mapping, with the values
          of the start at t = 0;
        * a `Spline` through samples.

        For many states a value may be an array (lanes), a sample of a spline one (knots, lanes).

        A leg may prescribe descriptors as well: ``{arch.height(0.5): 0.2, "Theta": None}``. As many
        parameters, given as None, are then unknown and found on the way. A way-point for a
        descriptor is approached at a constant rate from its present value.
    within
        Constraints, like ``[arch.max_curvature <= 10]``; the first violation ends the lift.
    through_folds
        Continue around folds (and through branch points) instead of ending there. A path that
        turns back passes its start on another sheet: this ends it ("returned").
    options
        Step control. `record` keeps all points of the lifts of many states (default: none); those
        of one state are always kept.
    progress
        Receives the number of finished lanes. If it raises `CancelledError` the lifts end: those
        of many states keep finished lanes, the rest are "cancelled".

    Returns
    -------
    The `Path` of one state; `Lifts` of many: ends and events, arrays (lanes). A numerical failure
    is an end of kind "lost" with the reason.

    Raises
    ------
    InputError
        If a state is no equilibrium, one state violates a constraint (of many, those end at once),
        or `to` has no meaning: an unknown parameter, a value outside its limits, a curve that is
        not smooth or begins elsewhere, more or fewer unknown parameters than descriptors, or
        nothing that moves.

    Examples
    --------
    >>> import equimorph as em
    >>> rest = em.Spring().natural_state(x_l=1.5)
    >>> em.lift(rest, {"F": 0.5}).end.kind
    'arrived'
    """
    options = replace(
        options or TraceOptions(record=isinstance(state, State)),
        through_folds=through_folds,
        through_branch_points=through_folds,
    )
    if isinstance(state, States):
        check_starts(state)
        return lift_many(state, to, tuple(within), options, progress)
    check_start(state, within)
    # what hides in the steps of one state is searched for afterwards, more thoroughly
    options = replace(options, record=True, look_inside=False)
    return lift_one(state, to, tuple(within), options, progress)
