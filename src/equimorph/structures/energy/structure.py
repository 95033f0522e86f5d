"""Structures given by the energy alone."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from functools import cached_property
from typing import Annotated, Any, ClassVar

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Bool, Flags, Float, Lanes, Parameters, Values
from equimorph.errors import InputError
from equimorph.linalg.intervals import Interval, join
from equimorph.linalg.sparse import SparseLayout
from equimorph.model import Constraint, Descriptor, Drawing, position, remember_call
from equimorph.structures.contract import Growth
from equimorph.structures.discrete import DiscreteStructure, along_corners
from equimorph.structures.energy.declarations import (
    Formula,
    Formulas,
    ParameterSpec,
    Symbols,
    UnknownSpec,
    check_promise,
    data_of,
    mass_rows,
    parameters_of,
    periods_of,
    points_of,
    unknowns_of,
)
from equimorph.structures.energy.drawing import (
    DrawnForce,
    DrawnSupport,
    energy_drawing,
    forces_of,
    marks_of,
)
from equimorph.structures.energy.expressions import POINT
from equimorph.structures.energy.soundness import (
    DEPENDENT,
    SAMPLES,
    Independence,
    check_periods,
    growth_of,
)
from equimorph.structures.energy.tape import Derivatives, Tape, can_enclose, casadi, enclosure, tape
from equimorph.structures.equations import Direction, Enclosed
from equimorph.structures.whole_turns import WholeTurns

INDEPENDENCE = "constraint_independence"
"""Descriptor of structures with constraints; see `Independence`."""


class EnergyStructure(DiscreteStructure):
    """Structure defined by formulas: an energy E(u; p) and constraints c(u; p) = 0.

    All derivatives are exact: CasADi [Andersson2019]_ forms the graphs of residual, KKT matrix, and
    their derivatives, and they run as tapes of instructions on a vector of lanes at a time. The
    matrix is kept sparse.

    Parameters
    ----------
    energy
        Formula as text, like ``"k*(1 - cos(phi)) - M*phi"``, or a scalar ``casadi.SX``.
    unknowns
        Names, symbols or `Unknown`s (with natural value, range of guesses, mass, unit).
    parameters
        `Parameter`s; their names are the symbols of the energy. A load is 0 by default.
    constraints
        Expressions that vanish.
    draw
        Points [x, y] of the line to draw. Without them the unknowns are drawn over their numbers.
    supports
        Supports to draw, as tables: the number of a `point` of `draw`, counted from 0, the `kind`
        ("pin", "clamp", "roller", "sleeve", "grip", "spring", "coil"; see `SupportKind`), and the
        `angle` of its direction. Points that no unknown moves are pins without being named.
    forces
        Forces to draw, as tables: the number of a `point`, and the `force` [x, y].
    descriptors
        More descriptors by name; every unknown and ``energy`` are there anyway. The first one is
        the height of figures of the set.
    definitions
        Parts of formulas by name, each in terms of the ones before.
    mass
        Physical masses, which say nothing of the metric: one formula per unknown, the diagonal of
        the mass matrix, or its rows. The unit of time is what the numbers make it.
    coercive
        The author's promise that the energy is smooth for all values of the unknowns and grows to
        infinity in all directions without a period; then the sum of (−1)^index over all equilibria
        is 1, or 0 where an unknown has a period, which tells whether some are missing. Polynomials
        with a positive definite leading form need no promise.

    Raises
    ------
    InputError
        For a formula that cannot be read, an unknown symbol, an unknown or parameter without
        effect, an energy that is not twice differentiable, a wrong shape, a natural state that is
        no equilibrium with all loads at zero, a period after which forces are others, or if CasADi
        is not installed.

    Examples
    --------
    `Spring`, from its energy:

    >>> from equimorph import EnergyStructure, Parameter, Unknown, lift
    >>> spring = EnergyStructure(
    ...     "k/2*(1 - x_l/cos(delta))**2 + F*x_l*tan(delta)",
    ...     [Unknown("delta", "acos(fmin(x_l, 1))", lower=-1.57, upper=1.57)],
    ...     [
    ...         Parameter("x_l", "natural length", 1.0, "actuator", 1.0, 0.0),
    ...         Parameter("F", "k", 1.0, "load", 0.0),
    ...         Parameter("k", "force/length", 1.0, "fixed", 1.0, 0.0),
    ...     ],
    ...     draw=[["x_l", 0], [0, "x_l*tan(delta)"]],
    ...     descriptors={"height": "x_l*tan(delta)"},
    ... )

    Pulled down, it snaps at the fold load k (1 − x_l^⅔)^(3/2):

    >>> path = lift(spring.natural_state(x_l=0.8), to={"F": 1.0})
    >>> path.end.kind, round(path.end.state["F"], 8), round((1 - 0.8 ** (2 / 3)) ** 1.5, 8)
    ('fold', 0.05139078, 0.05139078)
    """

    kind: ClassVar[str] = "energy"
    unresolved = "an unknown is beyond its limits: bound its descriptor"

    @check_arguments
    def __init__(  # noqa: PLR0913  # what an energy can have
        self,
        energy: Formula,
        unknowns: UnknownSpec | Sequence[UnknownSpec],
        parameters: Iterable[ParameterSpec],
        *,
        constraints: Sequence[Formula] = (),
        draw: Sequence[Annotated[Sequence[Any], POINT]] = (),
        supports: Sequence[DrawnSupport] = (),
        forces: Sequence[DrawnForce] = (),
        descriptors: Mapping[str, Formula] | None = None,
        definitions: Mapping[str, Formula] | None = None,
        mass: Sequence[Formula | Sequence[Formula]] = (),
        coercive: bool = False,
    ) -> None:
        self._unknowns, self.parameters = unknowns_of(unknowns), parameters_of(parameters)
        self.unknowns, self.constraints = len(self._unknowns), len(constraints)
        self.mass = np.array([float(unknown.mass) for unknown in self._unknowns])
        natural = tuple(unknown.natural for unknown in self._unknowns)
        points = points_of(draw)
        check_promise(coercive, self.constraints)
        self._coercive = coercive
        self._marks = marks_of(supports, len(points))
        self._loaded, pushes = forces_of(forces, len(points))
        given = Formulas(
            energy, tuple(constraints), natural, points, pushes, dict(descriptors or {}),
            mass_rows(mass, self.unknowns),
        )  # fmt: skip
        self._given, self._definitions = given, dict(definitions or {})
        self._symbols = Symbols(self._unknowns, self.parameters, self._definitions, given)
        formulas = self._symbols.formulas
        graph = (formulas.energy, formulas.constraints)
        self._graphs = Derivatives(self._symbols.u, self._symbols.p, *graph)
        self.check_natural_state([unknown.name for unknown in self._unknowns])
        check_periods(self.residual, self._unknowns, *self._trials)

    def identity(self) -> dict[str, Any]:
        """Kind, and all formulas as texts."""
        ca = casadi()
        definitions, formulas = self._definitions, self._given
        if any(isinstance(each, ca.SX) for each in (*definitions.values(), *formulas.flat())):
            definitions, formulas = self._symbols.texts()
        unknowns = [
            data_of(replace(unknown, natural=natural))
            for unknown, natural in zip(self._unknowns, formulas.natural, strict=True)
        ]
        pairs = zip(self._loaded, formulas.forces, strict=True)
        forces = [{"point": at, "force": list(force)} for at, force in pairs]
        drawn = {"supports": [mark.data() for mark in self._marks], "forces": forces}
        return {
            "kind": self.kind,
            "energy": formulas.energy,
            "unknowns": unknowns,
            "parameters": [data_of(parameter) for parameter in self.parameters],
            "constraints": list(formulas.constraints),
            "draw": [list(point) for point in formulas.draw],
            **{key: value for key, value in drawn.items() if value},
            **({"coercive": True} if self._coercive else {}),
            "descriptors": dict(formulas.descriptors),
            "definitions": dict(definitions),
            **({"mass": [list(row) for row in formulas.inertia]} if formulas.inertia else {}),
        }

    @property
    def massless(self) -> str:
        """How an energy is given its mass."""
        return 'Give each unknown one, like EnergyStructure(..., mass=["m*l**2"]).'

    def inertia(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes unknowns unknowns"]:
        """The author's mass matrix."""
        if not self._given.inertia:
            return super().inertia(z, p)
        full = self._inertia(z, p).reshape(len(z), self.unknowns, self.unknowns)
        return np.asarray(0.5 * (full + full.transpose(0, 2, 1)))

    @cached_property
    def _inertia(self) -> Tape:
        entries = [each for row in self._symbols.formulas.inertia for each in row]
        return self._graphs.tape(casadi().vertcat(*entries))

    # --- derivatives ----------------------------------------------------------------------------

    @property
    def layout(self) -> SparseLayout:
        """Sparsity of the KKT matrix."""
        return self._graphs.layout

    def energy(self, z: Lanes, p: Parameters) -> Values:
        """Potential energy E."""
        return self._graphs.energy(z, p)[:, 0].copy()

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """F(z; p)."""
        return self._graphs.residual(z, p)

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""
        return self._graphs.column(z, p, dp)

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w]."""
        return self._graphs.second(z, p, *v, *w)

    def enclosure(self, z: Interval, p: Interval) -> Enclosed | None:
        """Bounds over boxes by interval arithmetic on the tapes; None for unusual functions."""
        tapes = (self._graphs.residual, self._graphs.matrix, self._graphs.columns)
        if not all(can_enclose(tape) for tape in tapes):
            return None
        residual, entries, columns = (enclosure(tape, join([z, p], 1)) for tape in tapes)
        lanes, layout = z.shape[0], self.layout
        bounds = (layout.dense(each) for each in (entries.low, entries.high))
        shape = (lanes, len(self.parameters), self.size)
        by_p = (each.reshape(shape).transpose(0, 2, 1) for each in (columns.low, columns.high))
        return Enclosed(residual, Interval(*bounds), Interval(*by_p))

    def plain_energy(self) -> dict[str, Any] | None:
        """Instructions for L = E + λ·c, one after the other; None for unusual functions."""
        steps = self._graphs.lagrangian.instructions()
        return None if steps is None else {"kind": "program", "instructions": steps}

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂p."""
        return self._graphs.effort(z, p)

    def parts(self, z: Lanes, p: Parameters) -> tuple[np.ndarray, ...]:
        """Entries of F_z in the order of `layout`."""
        return (self._graphs.matrix(z, p),)

    def linearised(self, z: Lanes, p: Parameters, dp: Parameters) -> tuple[np.ndarray, ...]:
        """F, F_p·dp and the entries of F_z, from one tape."""
        values = self._graphs.step(z, p, dp)
        residual, column, entries = np.split(values, [self.size, 2 * self.size], axis=1)
        return residual, column, entries

    def growth(self, p: Float[np.ndarray, " parameters"]) -> Growth:
        """Whether the energy grows at infinity: shown for polynomials, or promised."""
        return growth_of(self._graphs.energy, self._unknowns, self.constraints, self._coercive, p)

    # --- states ---------------------------------------------------------------------------------

    @cached_property
    def _natural(self) -> Tape:
        return tape((self._symbols.p,), casadi().vertcat(*self._symbols.formulas.natural))

    def natural_guess(self, p: Parameters) -> Lanes:
        """Natural values of the unknowns, and the multipliers that balance them best."""
        return self._solve_multipliers(self._natural(p), p)

    def _solve_multipliers(self, u: Float[np.ndarray, "lanes n"], p: Parameters) -> Lanes:
        n = self.unknowns
        z = np.concatenate([u, np.zeros((len(u), self.constraints))], axis=1)
        if self.constraints:
            gradients = self.layout.dense(self.entries(z, p))[:, :n, n:]
            usable = np.isfinite(gradients).all(axis=(1, 2))
            inverse = np.linalg.pinv(gradients[usable])
            force = self.residual(z, p)[usable, :n]
            z[usable, n:] = -np.einsum("lmn,ln->lm", inverse, force)
        return z

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Unknowns within their ranges of guesses, with the multipliers that balance them best."""
        reach = np.array([each.reach for each in self._unknowns])
        u = self._natural(p) + reach * generator.uniform(-1.0, 1.0, (len(p), self.unknowns))
        for i, unknown in enumerate(self._unknowns):
            if unknown.range is not None:
                u[:, i] = generator.uniform(*unknown.range, len(p))
        return self._solve_multipliers(u, p)

    @cached_property
    def whole_turns(self) -> WholeTurns:
        """Whole periods of the unknowns that have one."""
        turns = periods_of(self._unknowns, self.size)
        return WholeTurns(turns, turns[:0])

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Unknowns are numbers within the limits of their meaning."""
        lower, upper = np.array([(each.lower, each.upper) for each in self._unknowns]).T
        u = z[:, : self.unknowns]
        good = np.isfinite(z).all(axis=1) & ((lower < u) & (u < upper)).all(axis=1)
        return np.asarray(good)

    @property
    def validity(self) -> tuple[Constraint, ...]:
        """Constraints must be independent; where they are not, no finite force holds them."""
        return (self.descriptor(INDEPENDENCE) >= DEPENDENT,) if self.constraints else ()

    @cached_property
    def _trials(self) -> tuple[Lanes, Parameters]:
        """Guesses at parameters that are 1 where they have no default."""
        generator = np.random.default_rng(0)
        p = np.nan_to_num(np.repeat(self._reference[None], SAMPLES, axis=0), nan=1.0)
        return self.sample(p, generator), p

    @cached_property
    def _independence(self) -> Independence:
        z, p = self._trials
        places = np.stack([self.layout.rows, self.layout.columns])
        return Independence(self.entries, places, self.mass, z, p)

    @cached_property
    def _corners(self) -> Tape:
        ca = casadi()
        draw = self._symbols.formulas.draw
        if not draw:
            heights = (*self._symbols.u.elements(), *([0.0] if self.unknowns == 1 else []))
            draw = tuple((float(i), height) for i, height in enumerate(heights))
        coordinates = [ca.SX(coordinate) for point in draw for coordinate in point]
        return self._graphs.tape(ca.vertcat(*coordinates))

    def shape(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points 2"]:
        """Points of the line to draw; `s` runs from 0 to 1 from the first to the last."""
        corners = self._corners(z, p).reshape(len(z), -1, 2)
        return corners if s is None else along_corners(corners, s)

    def drawing(self, z: Lanes, p: Parameters) -> Drawing:
        """Supports and forces as the author gives them; pins where no unknown moves a point."""
        vectors = self._pushes(z, p).reshape(len(z), len(self._loaded), 2)
        return energy_drawing(self.shape(z, p), self._still, self._marks, self._loaded, vectors)

    @cached_property
    def _pushes(self) -> Tape:
        ca = casadi()
        pushes = [ca.SX(each) for pair in self._symbols.formulas.forces for each in pair]
        return self._graphs.tape(ca.vertcat(*pushes))

    @cached_property
    def _still(self) -> Bool[np.ndarray, " written"]:
        """Which points of the line that the author wrote do not depend on the unknowns."""
        ca, draw = casadi(), self._symbols.formulas.draw
        moved = [
            any(ca.which_depends(ca.vertcat(*point), self._symbols.u, 1, False)) for point in draw
        ]
        return ~np.array(moved, bool)

    # --- descriptors ----------------------------------------------------------------------------

    @property
    def elevation(self) -> Descriptor:
        """The first descriptor of the author, or else the first unknown."""
        return self.descriptor(next(iter((*self._given.descriptors, self._unknowns[0].name))))

    @check_arguments
    @remember_call
    def descriptor(self, text: str) -> Descriptor:
        """Return the descriptor written as its name, or as ``effort(name)`` of a parameter."""
        name = text.replace(" ", "")
        formulas = self._symbols.formulas
        units = {unknown.name: unknown.unit for unknown in self._unknowns}
        if name in formulas.descriptors:
            program = self._graphs.tape(formulas.descriptors[name])
            return self._make_descriptor(name, "1", lambda z, p: program(z, p)[:, 0].copy())
        if name in units:
            at = list(units).index(name)
            return self._make_descriptor(name, units[name], lambda z, p: z[:, at].copy())
        if name == "energy":
            return self._make_descriptor(name, "energy", self.energy)
        if name == INDEPENDENCE and self.constraints:
            return self._make_descriptor(name, "1", self._independence)
        if name.startswith("effort(") and name.endswith(")"):
            column = position(self.parameters, name[7:-1])
            return self._make_descriptor(
                name, "1", lambda z, p: self.effort(z, p)[:, column].copy()
            )
        own = (INDEPENDENCE,) if self.constraints else ()
        known = ", ".join((*formulas.descriptors, *units, "energy", *own, "effort(parameter)"))
        raise InputError(f"`descriptor` must be one of {known}; got {text!r}.")

    def _make_descriptor(self, name: str, unit: str, function: Any) -> Descriptor:
        return Descriptor(name, unit, function, name, self.signature)
