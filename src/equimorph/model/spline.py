"""Smooth curves in parameter space through samples."""

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from scipy.interpolate import CubicSpline

from equimorph.argument_checks import check_arguments
from equimorph.array_types import Float
from equimorph.errors import InputError

Samples = Float[np.ndarray, "knots *lanes"]


class Spline:
    """Cubic spline through samples: ``Spline(Theta=[0.9, 1.1, 1.0], q=[0, 1, 3])``.

    The spline is twice continuously differentiable; its third derivative is continuous at the
    second knot and the last but one ("not a knot"). Three samples give a parabola, two a straight
    line.

    Parameters
    ----------
    t
        Knots, increasing from 0 to 1; equidistant if None.
    values
        Values of each parameter at the knots: (knots,), or (knots, lanes) for many lanes.

    Raises
    ------
    InputError
        If there are fewer than two samples, numbers of samples differ, or knots do not increase
        from 0 to 1.

    Examples
    --------
    >>> Spline(q=[0.0, 1.0, 4.0])(0.25)
    {'q': array(0.25)}
    """

    @check_arguments
    def __init__(
        self,
        t: Sequence[float] | Float[np.ndarray, " knots"] | None = None,
        /,
        **values: Sequence[float] | Samples,
    ) -> None:
        if not values:
            raise InputError("`Spline` must name at least one parameter; got none.")
        self.samples = {name: np.array(each, dtype=float) for name, each in values.items()}
        counts = {name: len(values) for name, values in self.samples.items()}
        knots = next(iter(counts.values()))
        if knots < 2 or len(set(counts.values())) > 1:
            raise InputError(
                f"`Spline` must have two or more samples, as many of each parameter; got {counts}."
            )
        self.t = np.linspace(0.0, 1.0, knots) if t is None else np.array(t, dtype=float)
        good = self.t.shape == (knots,) and self.t[0] == 0.0 and self.t[-1] == 1.0
        if not (good and (np.diff(self.t) > 0.0).all()):
            raise InputError(
                f"`t` must be {knots} numbers that grow from 0 to 1, one per sample; got {t!r}."
            )

    def __repr__(self) -> str:
        """Parameters and number of knots."""
        return f"Spline({', '.join(self.samples)}: {len(self.t)} knots)"

    @cached_property
    def pieces(self) -> dict[str, CubicSpline]:
        """The cubics of each parameter."""
        return {name: CubicSpline(self.t, values) for name, values in self.samples.items()}

    @check_arguments
    def __call__(self, t: float) -> dict[str, Float[np.ndarray, " *lanes"]]:
        """Values of the parameters at t between 0 and 1."""
        return {name: np.asarray(cubics(t)) for name, cubics in self.pieces.items()}
