"""Planar elastic rods."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Float, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Drawing, Parameter
from equimorph.structures.contract import Growth
from equimorph.structures.resolution import IN_PLANE, Waves
from equimorph.structures.rod.any_rod import AnyRod
from equimorph.structures.rod.clamped import ClampedMechanics
from equimorph.structures.rod.description import PlanarDescription
from equimorph.structures.rod.descriptors import Described
from equimorph.structures.rod.discretisation import ElementCount, mesh_with_kinks
from equimorph.structures.rod.drawing import ENDS, Amplitudes, rod_drawing, rod_supports
from equimorph.structures.rod.ends import End, EndSpec
from equimorph.structures.rod.general import GeneralMechanics
from equimorph.structures.rod.mechanics import SAMPLES, PlanarMechanics, discretisation_error
from equimorph.structures.rod.model import RodModel
from equimorph.structures.rod.natural import Natural, Outcome, natural_arch, natural_rod
from equimorph.structures.rod.profiles import (
    LoadShape,
    LoadSpec,
    MeasuredProfile,
    ProfileSpec,
    load_shape,
)
from equimorph.structures.rod.sections import CrossSection
from equimorph.structures.rod.space import check_terms
from equimorph.structures.rod.space_options import SpaceOptions
from equimorph.structures.rod.terms import LineLoad, Term, Terms
from equimorph.structures.unit_system import Quantity, Units

DEFAULT_SPAN = float(np.sin(1.0))
CLAMPED = ("clamped", "clamped")


def _all_default(stiffness: Any, curvature: Any, *others: Any) -> bool:
    """Whether options are those of the clamped, uniform, straight, inextensible rod."""
    numbers = all(isinstance(value, int | float) for value in (stiffness, curvature))
    return numbers and (stiffness, curvature) == (1.0, 0.0) and not any(others)


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


class Rod(Described):
    """Planar, unshearable elastic rod.

    Without options below `elements` it is the clamped, uniform, inextensible arch of length 1 under
    one vertical line load: energy ``E = ∫ θ'²/(8π²) ds − q ∫ ρ sin θ ds`` with ``ρ = ∫₀ˢ Q``;
    constraints ``∫ cos θ = ν`` and ``∫ sin θ = 0``; end angles θ(0) = Δ + Θ, θ(1) = Δ − Θ. In
    general ``E = ∫ ½ B (θ' − κ₀)² ds`` plus the potentials of loads and springs, and each end is
    held, free or sprung in x, y and θ. Gauss–Lobatto elements with quadrature at the nodes, so
    that energy, residual and Hessian agree exactly; element ends meet all kinks. Fields are
    recovered from the elements' ends, where they converge with twice the degree.

    Scales: lengths by L, forces by 4π²B/L², energies and couples by 4π²B/L, curvature by 1/L; with
    `EI` and `length` everything is in the user's units. Arclengths s are shares of the length, from
    0 at end A to 1 at end B. x points from A to B, y up; angles and couples count counterclockwise.

    Parameters
    ----------
    load
        "uniform", "left-half", a table [[s, Q], ...] or a callable Q(s). q > 0 acts downward. The
        default is uniform, unless there are `loads`.
    span
        Default of the parameter ν, distance of the ends in x where both are supported. Near 1 the
        clamped arch bends within about 1 − ν of its ends: the default elements resolve it up to
        ν = 0.99 at Θ = 0.9.
    kinks
        Arclengths at which a callable Q, stiffness or curvature is not smooth.
    elements, degree
        Resolution: the default, six elements of degree 9, keeps limit loads, heights and
        curvature within 1e-8 for max |κ| ≤ 10; `error_estimate` bounds what it loses beyond, and
        `resolving` takes as many elements as a larger bound needs.
    ends
        Ends A and B: "clamped", "pinned", "free", "sliding" (angle and y are held), or an `End`,
        also one that rolls along an inclined line: ``End("free", slide=0.5)``; the line's distance
        `offset` from the other end is then a parameter, by default so that it meets (span, rise).
    stiffness
        B(s) relative to B (to `EI`): a number, a table or a callable; positive.
    curvature
        Intrinsic curvature κ₀(s).
    axial
        Axial stiffness EA(s), in units of 4π²B/L² (of force). None: inextensible.
    loads
        More parameters of the role "load" by name, 0 by default: a `LineLoad`, `PointForce`,
        `Couple` or `Pressure`, or several of a kind that share the amplitude.
    actuators
        The same for the role "actuator"; `Curvature` patterns and `Tendon`s, above all.
    coordinates
        Named linear coordinates in place of parameters: ``{"turn": {"theta_A": 1, "theta_B": -1}}``
        means θ_A = turn and θ_B = −turn. By default Theta and Delta where both end angles are held;
        ``{}`` leaves theta_A and theta_B.
    rise
        Default of the parameter rise, of end B above A where both are supported.
    EI, length
        Bending stiffness and length; numbers are then dimensional.
    units
        Units of force and length of all numbers, like ``{"force": "mN", "length": "mm"}``; SI by
        default. EI, length, axial, curvature, span and rise may then be texts with units.
    torsion, lateral
        GJ and EI about the axis in the plane, with which `stable_in_space` and `lateral_margin`
        judge whether states leave their plane: relative to the bending stiffness in the plane
        (numbers, tables or callables), or texts with units. None: not judged.
    section
        A `Strip`, `Round`, `Tube` or `OwnSection` in place of EI, torsion and lateral. The rod is
        inextensible all the same, unless `axial` is given.
    mass
        Of the whole rod, in kg or as a text, for what happens in time: with EI and length, if no
        section gives it. Without these it is the unit.

    Raises
    ------
    InputError
        For an unknown load, values that are not finite, a span outside (0, 1), a resolution below 2
        elements or outside degrees 3 … 16, a support that lets the rod drift, stiffness that is not
        positive, a kink outside the rod, a follower load, inconsistent names, a section beside what
        it gives, or stiffnesses out of the plane for a rod under pressure.

    References
    ----------
    [Feher2025]_, equations (11)–(22).

    Examples
    --------
    A cantilever under a dead tip load of P L²/B = 2, in units of B and L:

    >>> from equimorph import PointForce, Rod, lift
    >>> rod = Rod(ends=("clamped", "free"), loads={"P": PointForce(1.0)}, EI=1.0, length=1.0)
    >>> bent = lift(rod.natural_state(), to={"P": 2.0}).end.state
    >>> round(-rod.height(1.0)(bent), 5)
    0.49346
    """

    kind: ClassVar[str] = "rod"
    waves: ClassVar[Waves] = IN_PLANE

    @check_arguments
    def __init__(  # noqa: PLR0913  # what a rod can have
        self,
        load: LoadSpec | None = None,
        span: Quantity | None = None,
        *,
        kinks: Sequence[float] = (),
        elements: ElementCount = 6,
        degree: int = 9,
        ends: Sequence[EndSpec] = CLAMPED,
        stiffness: ProfileSpec = 1.0,
        curvature: MeasuredProfile = 0.0,
        axial: MeasuredProfile | None = None,
        loads: Terms | None = None,
        actuators: Terms | None = None,
        coordinates: Mapping[str, Mapping[str, float]] | None = None,
        rise: Quantity = 0.0,
        EI: Quantity | None = None,
        length: Quantity | None = None,
        units: Units | None = None,
        torsion: MeasuredProfile | None = None,
        lateral: MeasuredProfile | None = None,
        section: CrossSection | Mapping[str, Any] | None = None,
        mass: Quantity | None = None,
    ) -> None:
        options = SpaceOptions.read(torsion, lateral, section)
        self._use_units(options, EI, length, units, {"span": span, "rise": rise}, mass)
        self.lateral_stiffness = self.space_options.stiffness(self.units, kinks)
        breaks = [] if self.lateral_stiffness is None else self.lateral_stiffness.breaks
        number = self.units.number
        stretched: ProfileSpec | None = number(axial, "force", "axial")
        curved: ProfileSpec = number(curvature, "1/length", "curvature")
        self.resolution, self._breaks = (elements, degree), breaks
        shape = "uniform" if load is None and loads is None else load
        self._load = None if shape is None else load_shape(shape, kinks)
        self._general: PlanarDescription | None = None
        given = (stretched, loads, coordinates)
        others = (*(each is not None for each in given), actuators, rise)
        arch = self._load is not None and tuple(ends) == CLAMPED and self.units.plain
        if self._load is not None and arch and _all_default(stiffness, curved, *others):
            self._become_arch(
                self._load, DEFAULT_SPAN if span is None else number(span, "length", "span")
            )
        else:
            own = {} if shape is None else {"q": LineLoad(shape, kinks=kinks)}
            reach = DEFAULT_SPAN * self.units.value("length")
            places = {
                "nu": reach if span is None else number(span, "length", "span"),
                "rise": number(rise, "length", "rise"),
            }
            profiles = {"stiffness": stiffness, "curvature": curved, "axial": stretched}
            self._general = PlanarDescription(
                ends, profiles, {**own, **(loads or {})}, actuators or {}, coordinates, places,
                kinks, self.units, breaks,
            )  # fmt: skip
            self._general.check_reach({"span": span, "rise": rise}, length)
            self.parameters = self._general.parameters
            made = self._general.in_own_parameters(self._raw.model)
            self._use_mechanics(GeneralMechanics(made))
        if self.has_lateral_stiffness:
            check_terms(self.terms)

    def _become_arch(self, load: LoadShape, span: float) -> None:
        elements, degree = self.resolution
        kinks = np.union1d(load.kinks, self._breaks)
        self._use_mechanics(ClampedMechanics(mesh_with_kinks(kinks, elements, degree), load))
        self.parameters = (
            Parameter("Theta", "rad", 1.0, "actuator"),
            Parameter("Delta", "rad", 1.0, "actuator", 0.0),
            Parameter("q", "4π²B/L²", 1.0, "load", 0.0),
            Parameter("nu", "L", 1.0, "fixed", self._check_span(span), 0.0, 1.0),
        )

    @staticmethod
    def _check_span(span: float) -> float:
        value = float(span)
        if not 0.0 < value < 1.0:
            raise InputError(
                f"`span` must lie between 0 and 1 (both excluded), the rod has length 1; "
                f"got {span!r}."
            )
        return value

    def plain_energy(self) -> dict[str, Any] | None:
        """Tables of the energy."""
        return self.mechanics.plain_energy()

    def identity(self) -> dict[str, Any]:
        """Kind, resolution, and everything that differs from the default arch."""
        data: dict[str, Any] = {}
        if self._general is not None:
            data = self._general.data()
        elif self._load is not None:
            if self._load.identity is None:
                raise InputError(
                    "`load` must be a name or a table to be written to a file; got a callable. "
                    "Sample it into a table [[s, Q], ...]."
                )
            data = {"load": self._load.identity, "span": self.parameters[3].default}
        return self._complete_identity(data, self.resolution)

    @cached_property
    def refined(self) -> PlanarMechanics:
        """The same rod with elements of a degree higher by four."""
        elements, degree = self.resolution
        degree = min(degree + 4, 16)
        if self._general is not None:
            raw = self._general.raw_model(elements, degree)
            return GeneralMechanics(self._general.in_own_parameters(raw))
        assert self._load is not None
        kinks = np.union1d(self._load.kinks, self._breaks)
        return ClampedMechanics(mesh_with_kinks(kinks, elements, degree), self._load)

    def _natural(self, p: Parameters) -> Natural:
        """Natural states and how each was met."""
        if self._general is None:
            return natural_arch(self.mechanics, p)
        return natural_rod(self._raw, self._general.raw_parameters(self._raw.model, p))

    @cached_property
    def _raw(self) -> GeneralMechanics:
        """Mechanics of a general rod in the raw parameters."""
        assert self._general is not None
        return GeneralMechanics(self._general.raw_model(*self.resolution))

    def natural(self, p: Parameters) -> tuple[Lanes, Flags]:
        """Unloaded rod, continued from its stress-free shape."""
        natural = self._natural(p)
        return natural.z, natural.outcome == Outcome.FOUND

    def in_reach(self, p: Parameters) -> Flags:
        """Whether the ends are at most as far apart as the rod is long, or it stretches."""
        if self._general is None:
            return np.asarray(np.abs(p[:, 3]) <= 1.0)
        return self._general.in_reach(self._raw.model, p)

    def may_be_natural(self, p: Parameters) -> Flags:
        """Θ > 0 for the arch: the straight rod has no upright side."""
        return p[:, 0] > 0.0 if self._general is None else np.ones(len(p), bool)

    def explain_no_natural_state(self, p: Float[np.ndarray, " parameters"]) -> str:
        """Error message where there is no natural state, with the reason for the arch."""
        if self._general is not None:
            return AnyRod.explain_no_natural_state(self, p)
        why = _why_not(self._natural(p[None]))
        return (
            f"`Theta`, `Delta` must have a natural state; got Theta={p[0]:g}, Delta={p[1]:g} "
            f"at nu={float(p[3])!r}. {why}"
        )

    def drawing(self, z: Lanes, p: Parameters) -> Drawing:
        """Supports of the ends, loads, tendons and segments that bend."""
        supports = rod_supports(self.ends, self.centreline(z, p, ENDS))
        return rod_drawing(self, supports, self._amplitudes(p), z, p)

    def _amplitudes(self, p: Parameters) -> Amplitudes:
        """Every term that acts on the rod, with its amplitude in the user's units."""
        if self._general is not None:
            return self._general.amplitudes(p)
        return [(self._arch_load, p[:, 2])]

    @property
    def _arch_load(self) -> LineLoad:
        assert self._load is not None
        return LineLoad(self._load.density, kinks=self._load.kinks.tolist())

    @property
    def ends(self) -> tuple[End, End]:
        """How ends A and B are supported."""
        return (End(), End()) if self._general is None else self._general.supports

    def growth(self, p: Float[np.ndarray, " parameters"]) -> Growth:
        """Not known: ever more states are wound up ever more, and the resolution cuts them off."""
        return Growth(False, "the resolution cuts off states that are wound up")

    def error_estimate(self, z: Lanes, p: Parameters) -> Values:
        """Bound of the errors of curvature and height, by solving again with a higher degree.

        Twice the largest change of max |κ|, and of κ(s) and y(s) at 25 arclengths; the heights'
        part is the smallest by far. Infinite where the finer rod has no equilibrium near the
        state, as may happen at a fold.
        """
        return discretisation_error(self.mechanics, self.refined, self.compared, z, p)

    @staticmethod
    def compared(
        rod: PlanarMechanics, z: Lanes, p: Parameters
    ) -> Float[np.ndarray, "lanes compared"]:
        """Largest |κ|, κ(s) and y(s), whose changes bound the error."""
        fields = rod.fields(z, p, SAMPLES)[:, :, [1, 3]].reshape(len(z), -1)
        return np.column_stack([rod.largest_curvature(z, p)[0], fields])

    # --- out of the plane -------------------------------------------------------------------

    @property
    def terms(self) -> dict[str, tuple[Term, ...]]:
        """Loads and actuators that act on the rod, by the name of their amplitude."""
        return {"q": (self._arch_load,)} if self._general is None else self._general.terms

    @cached_property
    def description(self) -> PlanarDescription:
        """The rod as a general one; the arch has a rise then, as its last parameter."""
        return self._general or PlanarDescription(
            CLAMPED, PlanarDescription.defaults, {"q": self._arch_load}, {}, None,
            {"nu": DEFAULT_SPAN, "rise": 0.0}, (), self.units, self._breaks,
        )  # fmt: skip

    @cached_property
    def lagrangian(self) -> RodModel:
        """Its Lagrangian; that of the arch as of a general rod with a rise."""
        if isinstance(self.mechanics, GeneralMechanics):
            return self.mechanics.model
        return self.description.in_own_parameters(self.description.raw_model(*self.resolution))
