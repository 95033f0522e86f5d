"""The clamped planar elastic rod with two rotary actuators at its ends."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from equimorph.errors import InputError
from equimorph.model import Descriptor, Parameter, parameter_vector
from equimorph.structures.rod import descriptors
from equimorph.structures.rod.discretisation import mesh_with_kinks
from equimorph.structures.rod.loads import LoadSpec, load_shape
from equimorph.structures.rod.mechanics import RodMechanics
from equimorph.structures.rod.natural import Natural, Outcome, natural_arch
from equimorph.structures.states import State, States

Lanes = Float[np.ndarray, "lanes size"]
Parameters = Float[np.ndarray, "lanes parameters"]

DEFAULT_SPAN = float(np.sin(1.0))


def _why_not(natural: Natural) -> str:
    """Reason and remedy for one state that was not found."""
    match natural.outcome[0]:
        case Outcome.NOT_UPRIGHT:
            return "Choose Theta > 0."
        case Outcome.FREE_FOLD:
            return (
                f"The free rod folds at {natural.scale[0]:.3g} of these angles. "
                "Choose smaller angles."
            )
        case Outcome.SPAN_FOLD:
            return (
                f"Continued from the free rod it ends at nu={natural.span[0]:.9g}. "
                "Choose a span nearer to the free one."
            )
    return (
        f"Pulled straighter than nu={natural.span[0]:.6f} it bends too sharply for the elements. "
        "Choose a span up to that, or more elements."
    )


class Rod(RodMechanics):
    """Planar, inextensible, unshearable elastic rod of length 1 with clamped ends.

    Energy ``E = ∫ θ'²/(8π²) ds − q ∫ ρ sin θ ds`` with ``ρ = ∫₀ˢ Q``; constraints ``∫ cos θ = ν``
    and ``∫ sin θ = 0``; end angles θ(0) = Δ + Θ, θ(1) = Δ − Θ. Gauss–Lobatto elements with
    quadrature at the nodes, so that energy, residual and Hessian agree exactly; element ends meet
    the kinks of the load. Fields are recovered from the elements' ends, where they converge with
    twice the degree. Scales: lengths by L, forces by 4π²B/L², energies by 4π²B/L, curvature
    by 1/L.

    Parameters
    ----------
    load
        "uniform", "left-half", a table [[s, Q], ...] or a callable Q(s). q > 0 acts downward.
    span
        Default of the parameter ν, distance of the ends, between 0 and 1. Near 1 the rod bends
        within about 1 − ν of its ends: the default elements resolve it up to ν = 0.99 at Θ = 0.9.
    kinks
        Arclengths at which a callable Q is not smooth.
    elements, degree
        Resolution: the default, six elements of degree 9, keeps limit loads, heights and
        curvature within 1e-8 for max |κ| ≤ 10; `error_estimate` bounds what it loses beyond.

    Raises
    ------
    InputError
        For an unknown load, values that are not finite, a span outside (0, 1), or a resolution
        below 2 elements or outside degrees 3 … 16.

    References
    ----------
    [Feher2025]_, equations (11)–(22).
    """

    def __init__(
        self,
        load: LoadSpec = "uniform",
        span: float = DEFAULT_SPAN,
        *,
        kinks: Sequence[float] = (),
        elements: int = 6,
        degree: int = 9,
    ) -> None:
        if not (isinstance(elements, int) and elements >= 2):
            raise InputError(f"`elements` must be a whole number >= 2; got {elements!r}.")
        if not (isinstance(degree, int) and 3 <= degree <= 16):
            raise InputError(f"`degree` must be a whole number from 3 to 16; got {degree!r}.")
        shape = load_shape(load, kinks)
        super().__init__(mesh_with_kinks(shape.kinks, elements, degree), shape)
        self._resolution = (elements, degree)
        self.parameters = (
            Parameter("Theta", "rad", 1.0, "actuator"),
            Parameter("Delta", "rad", 1.0, "actuator", 0.0),
            Parameter("q", "4π²B/L²", 1.0, "load", 0.0),
            Parameter("nu", "L", 1.0, "fixed", self._checked_span(span), 0.0, 1.0),
        )

    @staticmethod
    def _checked_span(span: float) -> float:
        try:
            value = float(span)
        except (TypeError, ValueError):
            value = np.nan
        if not 0.0 < value < 1.0:
            raise InputError(
                f"`span` must lie between 0 and 1 (both excluded), the rod has length 1; "
                f"got {span!r}."
            )
        return value

    def identity(self) -> dict[str, Any]:
        """Kind, load, span and resolution."""
        if self.load.identity is None:
            raise InputError(
                "`load` must be a name or a table to be written to a file; got a callable. "
                "Sample it into a table [[s, Q], ...]."
            )
        return {
            "kind": self.kind,
            "load": self.load.identity,
            "span": self.parameters[3].default,
            "elements": self._resolution[0],
            "degree": self._resolution[1],
        }

    def refined(self) -> "Rod":
        """Return the same rod with elements of a degree higher by four."""
        elements, degree = self._resolution
        named = self.load.identity is not None
        return Rod(
            self.load.identity if named else self.load.density,
            float(self.parameters[3].default or DEFAULT_SPAN),
            kinks=() if named else tuple(self.load.kinks),
            elements=elements,
            degree=min(degree + 4, 16),
        )

    def natural(self, p: Parameters) -> tuple[Lanes, Bool[np.ndarray, " lanes"]]:
        """Unloaded arch, continued from the straight rod."""
        natural = natural_arch(self, p)
        return natural.z, natural.outcome == Outcome.FOUND

    def may_be_natural(self, p: Parameters) -> Bool[np.ndarray, " lanes"]:
        """Θ > 0: the straight rod has no upright side."""
        return np.asarray(p[:, 0] > 0.0)

    def unloaded(self) -> Mapping[str, float]:
        """q = 0."""
        return {"q": 0.0}

    def natural_state(self, **values: float) -> State:
        """Natural state at given end angles: q = 0, continued from the straight rod.

        Raises
        ------
        InputError
            For unknown or meaningless parameters, q ≠ 0, Θ ≤ 0 (the straight rod has no upright
            side), where the continuation meets a fold, or where the elements do not resolve it.
        """
        if values.get("q", 0.0) != 0.0:
            raise InputError(f"`q` must be 0 in the natural state; got {values['q']!r}.")
        p = parameter_vector(self.parameters, values)
        natural = natural_arch(self, p[None])
        if natural.outcome[0] != Outcome.FOUND:
            raise InputError(
                f"`Theta`, `Delta` must have a natural state; got Theta={p[0]:g}, Delta={p[1]:g} "
                f"at nu={float(p[3])!r}. {_why_not(natural)}"
            )
        return State(self, natural.z[0], p)

    def natural_states(self, p: Parameters) -> tuple[States, Bool[np.ndarray, " lanes"]]:
        """Natural states of many settings, and which of them were found."""
        z, found = self.natural(p)
        return States(self, z, p), found

    def error_estimate(self, z: Lanes, p: Parameters) -> Float[np.ndarray, " lanes"]:
        """Bound of the errors of curvature and height, by solving again with a higher degree.

        Twice the largest change of max |κ|, and of κ(s) and y(s) at 25 arclengths; the heights'
        part is the smallest by far. Infinite where the finer rod has no equilibrium beside the
        state, as may happen at a fold.
        """
        return descriptors.discretisation_error(self, self.refined(), z, p)

    # --- descriptors ------------------------------------------------------------------------

    def height(self, s: float) -> Descriptor:
        """y(s), in units of L."""
        return descriptors.coordinate(self, s, 1)

    def position(self, s: float) -> tuple[Descriptor, Descriptor]:
        """(x(s), y(s)), in units of L."""
        return descriptors.coordinate(self, s, 0), descriptors.coordinate(self, s, 1)

    def angle(self, s: float) -> Descriptor:
        """θ(s) in radians."""
        return descriptors.angle(self, s)

    def curvature(self, s: float) -> Descriptor:
        """κ(s) in units of 1/L."""
        return descriptors.curvature(self, s)

    @cached_property
    def max_curvature(self) -> Descriptor:
        """max_s |κ(s)| in units of 1/L, ends and interior extrema included."""
        return descriptors.max_curvature(self)

    @cached_property
    def total_energy(self) -> Descriptor:
        """Potential energy E, in units of 4π²B/L."""
        return descriptors.total_energy(self)

    def support_force(self, component: str) -> Descriptor:
        """Force of the support at A on the rod: "lambda" (horizontal) or "mu" (vertical)."""
        return descriptors.support_force(self, component)

    def end_moment(self, end: int) -> Descriptor:
        """Couple of the actuator at end 0 or 1: ∂L/∂θ(end), in units of 4π²B/L."""
        return descriptors.end_moment(self, end)

    @property
    def elevation(self) -> Descriptor:
        """y(½)."""
        return self.height(0.5)

    def descriptor(self, text: str) -> Descriptor:
        """Return the descriptor written like ``height(0.5)`` or ``max_curvature``."""
        return descriptors.named(self, text)
