"""Planar rods in PyElastica [Gazzola2018]_: Cosserat rods that stretch and shear, a second physics.

The first and the last element are gripped at their centres, which are the ends of the rod. The
joints lie between the centres of successive elements and bend as the rod does there.

See docs/decisions.md, "PyElastica is an extra of its own".
"""

from typing import Any

import numpy as np

from equimorph.arrays import Float
from equimorph.dynamics.direct import DirectModel
from equimorph.dynamics.linkage import Linkage
from equimorph.dynamics.mechanism import Settings
from equimorph.dynamics.model import Plant, Points, Row, stable_near
from equimorph.dynamics.rods import ChainedRod, stiffness_and_rest
from equimorph.errors import InputError, load_package
from equimorph.structures import Rod, State, States
from equimorph.structures.rod.any_description import construction

RADIUS = 0.005
"""Radius of the round section relative to the length; EA is then 4/r² times B."""
COURANT = 0.25
"""Step in time relative to that in which a wave of tension passes an element."""
ROTARY = 16.0
"""Factor on the rotary inertia of elements, whose own frequency would else set the step in time;
the radius of gyration is then 0.01 of the length."""
LONGEST_ELEMENT = 0.08
"""Length of an element, relative to the rod's, beyond which its rotation sets the step in time."""
GRIPPED, BEFORE, BEHIND = [0, -1], [0, -2], [1, -1]
"""Elements that are gripped, and the nodes before and behind each of them."""
ENDS = "both ends clamped at prescribed places and angles"


def elastica_module() -> Any:
    """PyElastica, which only this simulator needs; see `load_package`."""
    otherwise = ', or choose simulator="mujoco"'
    return load_package("elastica", "replay-cosserat", "simulator", otherwise)


class CosseratModel(DirectModel):
    """A planar rod of which PyElastica simulates stretching, shear and bending.

    Its deviation is that of its elements, of its stretching and of the motion together. Damping
    acts on all velocities alike, with the rate η ω₁² that gives the first mode the same ratio.
    """

    simulator = "pyelastica"

    def __init__(self, structure: Rod, start: State, links: int) -> None:
        super().__init__(structure, start)
        self.chained = ChainedRod(structure, links)
        self.unit, self.elements = self.chained.time, links + 1
        self.centres = np.linspace(0.0, 1.0, self.elements)
        made = construction(structure.description, len(structure.parameters))
        self.stiffness, rest = stiffness_and_rest(made, self.centres)
        _check_covered(self.chained.linkage, rest)
        self.rest = rest[:, -1]

    def reference(self, states: States) -> Float[np.ndarray, "lanes points space"]:
        """Places at the centres of the elements."""
        return self.chained.places(states)[:, 0]

    def plant(self, start: State, step: float, damping: float) -> Plant:
        """The rod at rest at a state."""
        return CosseratPlant(self, start, step, self.damping_rate(damping) * self.unit)


def _check_covered(linkage: Linkage, rest: Float[np.ndarray, "joints settings"]) -> None:
    """Refuse by name what elements gripped at their centres do not describe."""
    held = linkage.supports
    others = {
        f"ends other than {ENDS}": not (
            np.isinf(held.stiffness).all() and np.isinf(held.turning).all()
        ),
        "pressure": bool(linkage.pressure.any()),
        "couples": bool(linkage.couples.any()),
        "stretching": bool(np.isfinite(linkage.axial).any()),
        "actuated curvature or tendons": bool(rest[:, :-1].any()),
    }
    for what, there in others.items():
        if there:
            raise InputError(
                f'`simulator` must cover the rod; got "pyelastica" for one with {what}. '
                'simulator="mujoco" covers it.'
            )


def _directors(angles: Float[np.ndarray, " elements"]) -> Float[np.ndarray, "3 3 elements"]:
    """Rows: the normal of the plane, their cross product, the tangent."""
    c, s, none = np.cos(angles), np.sin(angles), np.zeros(len(angles))
    return np.array([[none, none, none + 1.0], [s, -c, none], [c, s, none]])


class _Grips:
    """Places and angles of both ends, which change linearly during a step."""

    def __init__(self, linkage: Linkage, y: Settings) -> None:
        self._supports, self._length = linkage.supports, float(linkage.lengths[0, 0])
        self.time, self.duration = 0.0, 1.0
        self.before = self.after = self._end_poses(y)

    def _end_poses(self, y: Settings) -> Float[np.ndarray, "ends 3"]:
        """Place and angle of both ends."""
        held = self._supports
        places = np.einsum("nx,nxa->na", held.places @ y, held.axes)
        return np.column_stack([places, held.turns @ y])

    def move(self, y: Settings, time: float, duration: float) -> None:
        """The next step in time, and where it ends."""
        self.before, self.after = self.after, self._end_poses(y)
        self.time, self.duration = time, duration

    def hold(self, rod: Any, time: float) -> None:
        """Set places and directors of the gripped elements."""
        now = self._now(time)
        angles = now[:, 2]
        along = 0.5 * self._length * np.array([np.cos(angles), np.sin(angles)])
        rod.position_collection[:2, BEFORE] = now[:, :2].T - along
        rod.position_collection[:2, BEHIND] = now[:, :2].T + along
        rod.director_collection[:, :, GRIPPED] = _directors(angles)

    def lead(self, rod: Any, time: float) -> None:
        """Set the rates of the gripped elements."""
        angles = self._now(time)[:, 2]
        rates = (self.after - self.before) / self.duration
        turn = 0.5 * self._length * rates[:, 2] * np.array([-np.sin(angles), np.cos(angles)])
        rod.velocity_collection[:2, BEFORE] = rates[:, :2].T - turn
        rod.velocity_collection[:2, BEHIND] = rates[:, :2].T + turn
        rod.omega_collection[:, GRIPPED] = 0.0
        rod.omega_collection[0, GRIPPED] = rates[:, 2]

    def _now(self, time: float) -> Float[np.ndarray, "ends 3"]:
        """Place and angle of both ends."""
        share = min(max((time - self.time) / self.duration, 0.0), 1.0)
        now: Float[np.ndarray, "ends 3"] = self.before + share * (self.after - self.before)
        return now


class CosseratPlant(Plant):
    """A rod of length 1, mass 1 and forces by 4π²B/L² that moves in PyElastica."""

    def __init__(self, model: CosseratModel, start: State, step: float, rate: float) -> None:
        self._model, self._step = model, step
        self.p, self._time = start.p.copy(), 0.0
        linkage = model.chained.linkage
        self._table, self._y = linkage.forces[0], np.append(start.p, 1.0)
        self._forces = self._table @ self._y
        self._grips = _Grips(linkage, self._y)
        rod, self._energy_scale = self._build_rod(start), model.chained.energy
        element = min(1.0 / self.elements, LONGEST_ELEMENT)
        fastest = COURANT * element / np.sqrt(rod.shear_matrix[2, 2, 0])
        self._substeps = max(1, int(np.ceil(step / fastest)))
        self._rod = rod
        self._simulator, self._stepper = self._assemble(rod, rate, step / self._substeps)

    @property
    def elements(self) -> int:
        """Number of elements."""
        return self._model.elements

    def _build_rod(self, start: State) -> Any:
        """The rod in the shape of a state."""
        linkage, elements = self._model.chained.linkage, self.elements
        h = float(linkage.lengths[0, 0])
        fields = self._model.chained.fields(start.batch, self._model.centres)[0]
        tangents = np.column_stack([np.cos(fields[:, 0]), np.sin(fields[:, 0])])
        nodes = np.zeros((3, elements + 1))
        first = fields[0, 2:] - 0.5 * h * tangents[0]
        nodes[:2] = np.vstack([first, first + h * np.cumsum(tangents, axis=0)]).T
        bending = self._model.stiffness * h
        uniform = float(bending.mean())
        area = np.pi * RADIUS**2
        rod = elastica_module().CosseratRod.straight_rod(
            elements, np.zeros(3), np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]),
            elements * h, RADIUS, 1.0 / area, youngs_modulus=uniform / (0.25 * area * RADIUS**2),
            position=nodes, directors=_directors(fields[:, 0]),
        )  # fmt: skip
        rod.bend_matrix[0, 0] = bending
        rod.rest_kappa[0] = self._model.rest / h
        rod.mass_second_moment_of_inertia *= ROTARY
        rod.inv_mass_second_moment_of_inertia /= ROTARY
        return rod

    def _assemble(self, rod: Any, rate: float, step: float) -> tuple[Any, Any]:
        """Simulator with grips, loads and damping, and its integrator."""
        ea, plant, grips = elastica_module(), self, self._grips

        class Simulator(ea.BaseSystemCollection, ea.Constraints, ea.Forcing, ea.Damping):  # type: ignore[misc, name-defined]
            """What PyElastica composes."""

        class Grip(ea.ConstraintBase):  # type: ignore[misc, name-defined]
            """Both ends, as the schedule moves them."""

            def constrain_values(self, system: Any, time: Any) -> None:
                grips.hold(system, float(time))

            def constrain_rates(self, system: Any, time: Any) -> None:
                grips.lead(system, float(time))

        class Loads(ea.NoForces):  # type: ignore[misc, name-defined]
            """Dead forces on the elements, half on each of their nodes."""

            def apply_forces(self, system: Any, time: Any = 0.0) -> None:
                half = 0.5 * plant._forces.T
                system.external_forces[:2, :-1] += half
                system.external_forces[:2, 1:] += half

        simulator, last = Simulator(), self.elements
        simulator.append(rod)
        simulator.constrain(rod).using(
            Grip, constrained_position_idx=(0, 1, last - 1, last),
            constrained_director_idx=(0, last - 1),
        )  # fmt: skip
        simulator.add_forcing_to(rod).using(Loads)
        simulator.dampen(rod).using(
            ea.AnalyticalLinearDamper, uniform_damping_constant=rate, time_step=step
        )
        simulator.finalize()
        return simulator, ea.PositionVerlet()

    def set(self, p: Row) -> None:
        """Set the parameters."""
        self.p, self._y = p.copy(), np.append(p, 1.0)
        self._forces = self._table @ self._y

    def step(self) -> None:
        """One step in time, in as many of PyElastica as its fastest waves need.

        Raises `ArithmeticError` if the simulation has diverged.
        """
        self._grips.move(self._y, self._time, self._step)
        time, step = np.float64(self._time), np.float64(self._step / self._substeps)
        for _ in range(self._substeps):
            time = self._stepper.step(self._simulator, time, step)
        self._time += self._step
        if not np.isfinite(self._rod.position_collection).all():
            raise ArithmeticError("PyElastica's rod diverged; choose more damping or fewer links")

    @property
    def points(self) -> Points:
        """Centres of the elements."""
        nodes = self._rod.position_collection[:2].T
        return np.asarray(0.5 * (nodes[1:] + nodes[:-1]) * self._model.chained.length)

    @property
    def speed(self) -> float:
        """Largest speed of a node, in lengths per T."""
        return float(np.abs(self._rod.velocity_collection).max())

    @property
    def closure(self) -> float:
        """None: both ends are where they should be."""
        return 0.0

    @property
    def energy(self) -> float:
        """Potential and kinetic energy."""
        rod = self._rod
        rod.compute_internal_forces_and_torques(np.float64(self._time))
        strain = rod.compute_bending_energy() + rod.compute_shear_energy()
        kinetic = rod.compute_translational_energy() + rod.compute_rotational_energy()
        centres = self.points / self._model.chained.length
        work = float((self._forces * centres).sum())
        return float(strain + kinetic - work) * self._energy_scale

    def equilibrium(self) -> Points | None:
        """The stable equilibrium of the structure nearby."""
        state = stable_near(self._model.structure, self.guess(), self.p)
        return None if state is None else np.asarray(self._model.reference(state.batch)[0])

    def guess(self) -> Float[np.ndarray, " size"]:
        """Unknowns of the rod, multipliers 0."""
        d3 = self._rod.director_collection[2]
        angles = np.unwrap(np.arctan2(d3[1], d3[0]))
        turned = self._grips.after[0, 2] - angles[0]
        angles += 2.0 * np.pi * np.round(turned / (2.0 * np.pi))
        return self._model.chained.unknowns_through(self._model.centres, angles)
