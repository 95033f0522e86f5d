"""Elastic rods in space."""

from collections.abc import Mapping, Sequence
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Float, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.model import Drawing, parameter_vector
from equimorph.structures.discrete import correct_at_parameters
from equimorph.structures.resolution import IN_SPACE, Waves
from equimorph.structures.rod.discretisation import ElementCount
from equimorph.structures.rod.drawing import ENDS, rod_drawing, rod_supports
from equimorph.structures.rod.mechanics import SAMPLES, discretisation_error
from equimorph.structures.rod.profiles import LoadSpec, MeasuredProfile, ProfileSpec, load_shape
from equimorph.structures.rod.sections import CrossSection
from equimorph.structures.rod.space_options import SpaceOptions
from equimorph.structures.rod.terms import LineLoad, Term, Terms
from equimorph.structures.spatial.description import SpatialDescription
from equimorph.structures.spatial.descriptors import DescribedInSpace
from equimorph.structures.spatial.ends import Ends
from equimorph.structures.spatial.fields import SpatialFields
from equimorph.structures.spatial.mechanics import SpatialMechanics
from equimorph.structures.spatial.natural import (
    natural_states,
    pinned_guess,
    pinned_natural_states,
    planar_guess,
)
from equimorph.structures.spatial.orbits import OrbitMechanics
from equimorph.structures.spatial.phase import PinnedMechanics
from equimorph.structures.spatial.quaternions import LONGEST_STEP, with_unit_rotations
from equimorph.structures.spatial.windings import GUESSES
from equimorph.structures.states import State
from equimorph.structures.unit_system import Quantity, Units

DEFAULT_SPAN = float(np.sin(1.0))
CLAMPED = ("clamped", "clamped")
NEAR = 1e-6
"""By how much quaternions may be longer than 1 at a corrected state."""


class SpatialRod(DescribedInSpace):
    """Elastic rod in space: it bends about two axes and twists, and may stretch and shear.

    Energy ``E = ∫ ½ (u − u₀)·K (u − u₀) ds`` plus the potential of dead loads, with the strains u:
    the twist and the curvatures about the axes n and b of the cross-section; constraints
    ``∫ t ds = place of end B``. Unit quaternions at Gauss–Lobatto nodes with quadrature at the
    nodes, so that energy, residual and Hessian agree exactly; critical loads converge with twice
    the degree. Planar states lie in z = 0: t is the tangent, n the normal on its left, b along z.

    Scales as of `Rod`: lengths by L, forces by 4π²B/L², energies and couples by 4π²B/L, curvatures
    by 1/L; with `EI` or a section, and `length`, all numbers are in the user's units. Arclengths s
    are shares of the length, from 0 at end A to 1 at end B.

    Parameters are, in this order: the coordinates; of each end whose rotation is held the angles
    ``theta_A``, ``tilt_A``, ``twist_A`` of R = exp(e₃ θ) exp(e₂ tilt) exp(e₁ twist); actuators;
    loads; and where both ends are supported the place ``nu``, ``rise``, ``sideways`` of end B along
    x, y and z. Between clamps, Theta and Delta stand for θ_A = Δ + Θ, θ_B = Δ − Θ. A clamp turned
    by a twist of 4π is the same again, one turned by 2π holds the rod with another link.

    Parameters
    ----------
    load
        "uniform", "left-half", a table [[s, Q], ...] or a callable Q(s): a line load q, positive
        downward. The default is uniform, unless there are `loads`.
    span
        Default of the parameter nu.
    torsion, lateral
        GJ and EI out of the plane, for bending about n: relative to the bending stiffness in the
        plane, about b (numbers, tables or callables), or texts with units.
    section
        A `Strip`, `Round`, `Tube` or `OwnSection` in place of EI, torsion and lateral.
    ends
        Ends A and B: "clamped", "pinned" (a ball joint), "free", "guided" (rotation, y and z are
        held), or a `SpatialEnd`. One of them has to hold the rotation.
    stiffness
        Bending stiffness about b relative to B (to `EI`): a number, a table or a callable.
    curvature, side_curvature, natural_twist
        Intrinsic curvature about b, about n, and intrinsic twist: numbers, tables or callables.
    axial, shear
        Axial stiffness EA(s), and stiffness against shear along n and b, in units of force. None:
        rigid.
    loads
        More parameters of the role "load" by name, 0 by default: a `LineLoad` or `PointForce` with
        directions (x, y, z), or several of a kind that share the amplitude. All are dead loads.
    actuators
        The same for the role "actuator"; `Curvature` patterns about any axis and `Tendon`s, above
        all. A small curvature about n, or a load along z, is an imperfection that breaks the
        symmetry of planar states.
    coordinates
        Named linear coordinates in place of parameters; see `Rod`. ``{}`` leaves theta_A, theta_B.
    rise, sideways
        Defaults of the place of end B along y and z.
    phase
        True pins states on their orbits. Where the bending stiffnesses are equal and nothing acts
        across the axis of the clamps, the x axis, a state off the axis may be turned about it for
        nothing: F_z is singular, and no event is a true one. A condition with a multiplier, which
        is 0 at equilibria, picks the state with ``∫ g t_z ds = 0``; theta, tilt, rise and sideways
        are no parameters then. Margins are those on this condition.
    kinks
        Arclengths at which a callable is not smooth.
    elements, degree
        Resolution: the default, six elements of degree 6, gives critical loads of the arch to 3e-9.
        `resolving` takes as many elements as a bound of the curvature needs.
    EI, length, units, mass
        As of `Rod`. The mass lies on the centre line: cross-sections have no rotary inertia.

    Raises
    ------
    InputError
        For stiffnesses that are missing or not positive, an end B that is out of reach, supports
        that let the rod drift or spin, couples and pressure (they have no potential in space), and
        as for `Rod`.

    References
    ----------
    [Antman2005]_, chapter VIII: the theory of Kirchhoff and Cosserat rods.

    Examples
    --------
    A cantilever strip bends in its plane under its tip load:

    >>> from equimorph import PointForce, SpatialRod, lift
    >>> ends, tip = ("clamped", "free"), {"P": PointForce(1.0)}
    >>> rod = SpatialRod(torsion=0.8, lateral=50.0, ends=ends, loads=tip, EI=1.0, length=1.0)
    >>> bent = lift(rod.natural_state(), to={"P": 2.0}).end.state
    >>> round(-rod.height(1.0)(bent), 5)
    0.49346
    """

    kind: ClassVar[str] = "spatial rod"
    longest_step = LONGEST_STEP
    waves: ClassVar[Waves] = IN_SPACE

    @check_arguments
    def __init__(  # noqa: PLR0913  # what a rod can have
        self,
        load: LoadSpec | None = None,
        span: Quantity | None = None,
        *,
        torsion: MeasuredProfile | None = None,
        lateral: MeasuredProfile | None = None,
        section: CrossSection | Mapping[str, Any] | None = None,
        ends: Sequence[Any] = CLAMPED,
        stiffness: ProfileSpec = 1.0,
        curvature: MeasuredProfile = 0.0,
        side_curvature: MeasuredProfile = 0.0,
        natural_twist: MeasuredProfile = 0.0,
        axial: MeasuredProfile | None = None,
        shear: MeasuredProfile | None = None,
        loads: Terms | None = None,
        actuators: Terms | None = None,
        coordinates: Mapping[str, Mapping[str, float]] | None = None,
        rise: Quantity = 0.0,
        sideways: Quantity = 0.0,
        phase: bool = False,
        kinks: Sequence[float] = (),
        elements: ElementCount = 6,
        degree: int = 6,
        EI: Quantity | None = None,
        length: Quantity | None = None,
        units: Units | None = None,
        mass: Quantity | None = None,
    ) -> None:
        options = SpaceOptions.read(torsion, lateral, section)
        lengths = {"span": span, "rise": rise, "sideways": sideways}
        self._use_units(options, EI, length, units, lengths, mass)
        number = self.units.number
        shape = "uniform" if load is None and loads is None else load
        own = {} if shape is None else {"q": LineLoad(shape, kinks=kinks)}
        if shape is not None:
            load_shape(shape, kinks)
        reach = DEFAULT_SPAN * self.units.value("length")
        self.resolution = (elements, degree)
        profiles = {
            "stiffness": stiffness,
            "curvature": number(curvature, "1/length", "curvature"),
            "side_curvature": number(side_curvature, "1/length", "side_curvature"),
            "natural_twist": number(natural_twist, "1/length", "natural_twist"),
            "axial": number(axial, "force", "axial"),
            "shear": number(shear, "force", "shear"),
        }
        self._description = SpatialDescription(
            ends,
            profiles | self._ratios(),
            {**own, **(loads or {})},
            actuators or {},
            coordinates,
            {
                "nu": reach if span is None else float(number(span, "length", "span")),
                "rise": float(number(rise, "length", "rise")),
                "sideways": float(number(sideways, "length", "sideways")),
            },
            kinks,
            self.units,
            phase=phase,
        )
        self.description.check_places(lengths, length)
        self.parameters = self.description.parameters
        self._use_mechanics(self.description.mechanics(self._raw.model))

    def _ratios(self) -> dict[str, Any]:
        """Stiffnesses against twist and out of the plane, relative to that in the plane."""
        made = self.space_options.properties(self.units)
        if made is not None:
            return {"torsion": made.torsion, "lateral": made.lateral}
        if self.space_options.torsion is None:
            raise InputError(
                "`torsion`, `lateral` must be given for a rod in space; got neither. Give these, "
                "like torsion=0.77, lateral=1.0 for a round one, or a section."
            )
        names = ("torsion", "lateral")
        return {name: self.space_options.ratio(name, self.units) for name in names}

    def identity(self) -> dict[str, Any]:
        """Kind, resolution, and everything that differs from the default."""
        return self._complete_identity(self.description.data(), self.resolution)

    @property
    def guesses_per_start(self) -> float:
        """More where some wind."""
        return GUESSES if self.mechanics.most_windings else 1.0

    # --- natural states -------------------------------------------------------------------------

    @cached_property
    def _raw(self) -> SpatialMechanics:
        """Mechanics in the raw parameters."""
        return SpatialMechanics(self.description.raw_model(*self.resolution))

    def natural(self, p: Parameters) -> tuple[Lanes, Flags]:
        """Unloaded rod, continued from its stress-free shape."""
        given = self.description.raw_parameters(self._raw.model, p)
        if isinstance(self.mechanics, PinnedMechanics):
            return pinned_natural_states(self.mechanics, self._raw, p, given)
        return natural_states(self._raw, given)

    def in_reach(self, p: Parameters) -> Flags:
        """Whether the ends are at most as far apart as the rod is long, or it stretches."""
        return self.description.in_reach(self._raw.model, p)

    @check_arguments
    def planar_state(self, state: Any, **values: float) -> State:
        """State of a planar rod as a state of this one, in the plane z = 0.

        Rotations are taken from the planar rod's angles, and corrected by Newton's method.

        Parameters
        ----------
        state
            A `State` of a `Rod` with the same supports and loads.
        **values
            Parameters that the planar rod lacks or names otherwise; the others are taken from
            `state` by their names, or have their defaults.

        Raises
        ------
        InputError
            For anything else, or where the correction does not converge: the rods differ.
        """
        z = planar_guess(self.mechanics, state)
        names = [each.name for each in self.parameters]
        known = {name: value for name, value in state.parameters.items() if name in names}
        p = parameter_vector(self.parameters, {**known, **values})[None]
        z, found = correct_at_parameters(self, z, p)
        if not found[0] or np.abs(z[:, : self.unknowns]).max() > 1.0 + NEAR:
            raise InputError(
                "`state` must be one of a planar rod with the same supports, loads and stiffness; "
                f"got {state!r}, near which this rod has no equilibrium."
            )
        return State(self, z[0], p[0])

    @check_arguments
    def pinned_state(self, state: Any) -> State:
        """State of a rod between coaxial clamps as one of this rod, which has a phase condition.

        It is turned as a whole until the clamps lie on the x axis, then about this axis until it
        meets the condition, and corrected by Newton's method. Clamps that were turned all round are
        twisted by 2π more: a ring is a straight rod's state with a twist of 2π.

        Raises
        ------
        InputError
            If this rod has no phase condition, the clamps of `state` are not coaxial, or the
            correction does not converge: the rods differ.
        """
        rod = self.mechanics
        if not isinstance(rod, PinnedMechanics):
            raise InputError(
                "`pinned_state` must be asked of a rod with phase=True; got one without."
            )
        z, clamps = pinned_guess(rod, state)
        names = [each.name for each in self.parameters]
        given = {**state.parameters, **clamps}
        known = {name: value for name, value in given.items() if name in names}
        p = parameter_vector(self.parameters, known)[None]
        z, found = correct_at_parameters(self, rod.aligned(z), p)
        if found[0] and rod.resolved(z, p)[0]:
            return State(self, z[0], p[0])
        raise InputError(
            "`state` must be one of a rod with the same supports, loads and stiffness; "
            f"got {state!r}, near which this rod has no equilibrium."
        )

    def may_resolve(self, z: Lanes, p: Parameters) -> Flags:
        """Whether rotations jump nowhere: those that do are equilibria of the elements alone."""
        return self.mechanics.may_resolve(z, p)

    def have_orbits(self, p: Parameters) -> Flags:
        """Whether states off the x axis may be turned about it for nothing."""
        rod = self.mechanics
        return rod.have_orbits(p) if isinstance(rod, OrbitMechanics) else np.zeros(len(p), bool)

    def special_guesses(self, p: Parameters) -> Float[np.ndarray, "guesses lanes size"]:
        """Rods that turn evenly from one clamp to the other, with whole turns more or less."""
        return self.mechanics.with_whole_turns(p)

    def as_guess(self, mean: Lanes) -> Lanes:
        """Means of states with rotations: quaternions of length 1."""
        return with_unit_rotations(mean, self.unknowns)

    def along_orbits(self, z: Lanes, p: Parameters) -> Lanes:
        """Rates at which states off the x axis turn about it, where they may for nothing."""
        return self.mechanics.along_orbits(z, p)

    def pick_on_orbits(self, z: Lanes, p: Parameters, towards: Parameters) -> Lanes:
        """States on orbits along the way are turned about the axis to the phase condition."""
        rod = self.mechanics
        return rod.pick_on_orbits(z, p, towards) if isinstance(rod, OrbitMechanics) else z

    def error_estimate(self, z: Lanes, p: Parameters) -> Values:
        """Bound of the errors of curvature and place, by solving again with a higher degree.

        Twice the largest change of max |κ|, and of strains and places at 25 arclengths. Infinite
        where the finer rod has no equilibrium near the state, as may happen at a fold.
        """
        return discretisation_error(self.mechanics, self._refined, self.compared, z, p)

    @staticmethod
    def compared(
        rod: SpatialMechanics, z: Lanes, p: Parameters
    ) -> Float[np.ndarray, "lanes compared"]:
        """Largest bending curvature, strains and places, whose changes bound the error."""
        recovery = SpatialFields(rod)
        here = recovery.at(z, p, SAMPLES)
        fields = np.concatenate([here.strains, here.places], axis=2).reshape(len(z), -1)
        return np.column_stack([recovery.largest_curvature(z, p)[0], fields])

    @cached_property
    def _refined(self) -> SpatialMechanics:
        elements, degree = self.resolution
        raw = self.description.raw_model(elements, min(degree + 4, 16))
        return self.description.mechanics(raw)

    def drawing(self, z: Lanes, p: Parameters) -> Drawing:
        """Supports of the ends, loads, tendons and segments that bend."""
        supports = rod_supports(self.ends, self.centreline(z, p, ENDS))
        return rod_drawing(self, supports, self.description.amplitudes(p), z, p)

    @property
    def description(self) -> SpatialDescription:
        """The rod as its user describes it."""
        return self._description

    @property
    def ends(self) -> Ends:
        """How ends A and B are supported."""
        return self.description.supports

    @property
    def terms(self) -> dict[str, tuple[Term, ...]]:
        """Loads and actuators that act on the rod, by the name of their amplitude."""
        return self.description.terms
