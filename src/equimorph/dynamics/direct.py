"""Structures that a simulator takes as they are, without a chain: trusses, and all by their own."""

from abc import abstractmethod
from typing import Any

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters
from equimorph.dynamics.balance import FoldDelay
from equimorph.dynamics.model import Course, Model, Motion, Plant, Points, Row, stable_near
from equimorph.dynamics.motion import equilibria_along
from equimorph.dynamics.plant import mujoco_module
from equimorph.dynamics.spatial_rods import check_isolated
from equimorph.dynamics.writer import document
from equimorph.errors import InputError
from equimorph.structures import SpatialRod, State, States, Structure, Truss
from equimorph.structures.margin import generic_vectors, inverse_step
from equimorph.structures.metric import metric_length

FIRST_MODE = 5.0
"""Lowest angular frequency at the start in units of 1/T: about that of a clamped arch."""
PROBE = 1e-5
"""Relative step of difference quotients."""
SWEEPS = 4
"""Inverse iterations for the critical mode."""


class DirectModel(Model):
    """A structure whose equations a plant takes over unknown by unknown."""

    def __init__(self, structure: Structure, start: State) -> None:
        if structure.sprung is not None:
            raise InputError(
                "`structure` must not move with springs at its supports whose places its unknowns "
                f"leave free; this {structure.kind} does. Replay its schedule in MuJoCo, or hold "
                "these supports."
            )
        if isinstance(structure, SpatialRod):
            check_isolated(structure, start, self.simulator)
        self.structure = structure
        self.frequency = float(start.batch.natural_frequencies(1)[0, 0])
        self.unit = FIRST_MODE / self.frequency

    def reference(self, states: States) -> Float[np.ndarray, "lanes points space"]:
        """Shapes as they are drawn."""
        return self.structure.shape(states.z, states.p)

    def damping_rate(self, damping: float) -> float:
        """Rate η ω₁² of C = η ω₁² M, with which ζ₁ = ½ η ω₁; η in units of T."""
        return damping * self.unit * self.frequency**2

    def resistance(
        self, z: Lanes, p: Parameters, mode: Float[np.ndarray, " unknowns"], damping: float
    ) -> float:
        """Damping matrix times a velocity twice; damping in units of T."""
        heavy = float(self.structure.inertia_product(z, p)(mode[None, None])[0, 0] @ mode)
        return self.damping_rate(damping) * heavy

    def statics(
        self, start: State, motion: Motion, times: Float[np.ndarray, " times"], damping: float
    ) -> Course:
        """Equilibria of the library, which are the plant's."""
        rows = np.array([motion(t) for t in times])
        found = equilibria_along(self, start, rows)
        if found.end is None:
            return Course(found.points)
        last = self.reference(found.end.batch)[0]
        fold = float(np.interp(found.at, np.arange(len(times)), times))
        if found.kind != "fold":
            ends = fold if found.kind == "branch point" else float("nan")
            return Course(found.points, ends, None, last)
        return Course(found.points, fold, self._normal_form(found.end, fold, motion, damping), last)

    def _normal_form(self, fold: State, time: float, motion: Motion, damping: float) -> FoldDelay:
        structure, n = self.structure, self.structure.unknowns
        z, p = fold.z[None], fold.p[None]
        wide = generic_vectors(structure, 1)[0]
        for _ in range(SWEEPS):
            wide = inverse_step(structure, z, p, wide[None, :n])[0]
            wide /= metric_length(structure, wide)
        step = PROBE * max(abs(time), 1e-12)
        rate = (motion(time + step) - motion(time - step)) / (2.0 * step)
        drive = -float(wide @ structure.parameter_derivative(z, p, rate[None])[0])
        along = (wide[None], np.zeros_like(p))
        bend = -0.5 * float(wide @ structure.second_derivative(z, p, along, along)[0])
        if bend < 0.0:
            drive, bend = -drive, -bend
        inertia = float(structure.inertia_product(z, p)(wide[None, None, :n])[0, 0] @ wide[:n])
        apart = self.reference(_move(fold, PROBE * wide)) - self.reference(
            _move(fold, -PROBE * wide)
        )
        reach = float(np.linalg.norm(apart[0], axis=1).max()) / (2.0 * PROBE)
        return FoldDelay(inertia, self.resistance(z, p, wide[:n], damping), drive, bend, reach)


def _move(state: State, by: Float[np.ndarray, " size"]) -> States:
    return States(state.structure, (state.z + by)[None], state.p[None])


class DirectPlant(Plant):
    """A plant whose unknowns are those of the structure."""

    structure: Structure
    p: Row

    @property
    @abstractmethod
    def z(self) -> Float[np.ndarray, " size"]:
        """Unknowns and multipliers."""

    @property
    @abstractmethod
    def velocity(self) -> Float[np.ndarray, " unknowns"]:
        """Rates of the unknowns."""

    @property
    def points(self) -> Points:
        """The shape as it is drawn."""
        return np.asarray(self.structure.shape(self.z[None], self.p[None])[0])

    @property
    def closure(self) -> float:
        """Largest residual of a constraint."""
        n = self.structure.unknowns
        rest = self.structure.residual(self.z[None], self.p[None])[0, n:]
        return float(np.abs(rest).max(initial=0.0))

    @property
    def energy(self) -> float:
        """Potential and kinetic energy."""
        z, p, v = self.z[None], self.p[None], self.velocity
        kinetic = 0.5 * float(self.structure.inertia_product(z, p)(v[None, None])[0, 0] @ v)
        potential = float(self.structure.energy(z, p)[0])
        return (potential + kinetic) * self.structure.energy_scale

    def equilibrium(self) -> Points | None:
        """The stable equilibrium of the structure nearby."""
        state = stable_near(self.structure, self.z, self.p)
        return None if state is None else state.shape()

    def guess(self) -> Float[np.ndarray, " size"]:
        """Unknowns and multipliers."""
        return self.z.copy()


class TrussModel(DirectModel):
    """A truss with engineering strain, whose bars are springs of stiffness EA/l₀."""

    simulator = "mujoco"

    def __init__(self, truss: Truss, start: State) -> None:
        if truss.energies.green:
            raise InputError(
                '`simulator` must cover the strain of the truss; got "mujoco" for Green strain, '
                'whose bars are no linear springs. Use strain="engineering", or simulator="own".'
            )
        super().__init__(truss, start)
        self.truss = truss

    def plant(self, start: State, step: float, damping: float) -> Plant:
        """The truss at rest at a state."""
        return TrussPlant(self.truss, start, step * self.unit, damping * self.unit)

    def resistance(
        self, z: Lanes, p: Parameters, mode: Float[np.ndarray, " unknowns"], damping: float
    ) -> float:
        """Damping of the bars along the mode."""
        spans = self.truss.spans(z)[0]
        moved = (self.truss.spans(z + mode) - self.truss.spans(z))[0]
        rates = (spans * moved).sum(axis=1) / np.linalg.norm(spans, axis=1)
        stiff = self.truss.energies.stiffness / self.truss.rest_lengths(p)[0]
        return float(damping * self.unit * (stiff @ rates**2))


class TrussPlant(DirectPlant):
    """Point masses that slide along the free axes of their joints."""

    def __init__(self, truss: Truss, start: State, step: float, damping: float) -> None:
        self._mujoco = mujoco_module()
        self.structure, self._truss, self._damping = truss, truss, damping
        masses = np.diag(truss.inertia(start.z[None], start.p[None])[0])
        self._model: Any = self._mujoco.MjModel.from_xml_string(_text(truss, masses, step))
        self._data: Any = self._mujoco.MjData(self._model)
        self.p = start.p.copy()
        self._write(start.p)
        self._data.qpos[:] = start.z
        self._mujoco.mj_forward(self._model, self._data)

    def set(self, p: Row) -> None:
        """Set rest lengths and loads."""
        if not np.array_equal(p, self.p):
            self._write(p)

    def _write(self, p: Row) -> None:
        truss, model = self._truss, self._model
        rests = truss.rest_lengths(p[None])[0]
        stiff = truss.energies.stiffness / rests
        # the linear part; MuJoCo has polynomials of the length in further columns, if it has any
        for field, values in (
            (model.tendon_stiffness, stiff), (model.tendon_damping, self._damping * stiff),
        ):  # fmt: skip
            field.reshape(len(rests), -1)[:, 0] = values
        model.tendon_lengthspring[:] = rests[:, None]
        self._data.qfrc_applied[:] = p @ truss.pulls
        self.p = p.copy()

    def step(self) -> None:
        """One step in time."""
        self._mujoco.mj_step(self._model, self._data)

    @property
    def z(self) -> Float[np.ndarray, " size"]:
        """Displacements of the joints."""
        return np.array(self._data.qpos)

    @property
    def velocity(self) -> Float[np.ndarray, " unknowns"]:
        """Their rates."""
        return np.array(self._data.qvel)

    @property
    def speed(self) -> float:
        """Largest rate of a displacement, relative to the mean length of the bars."""
        size = float(self._truss.network.lengths.mean())
        return float(np.abs(self._data.qvel).max()) / size


def _text(truss: Truss, masses: Float[np.ndarray, " unknowns"], step: float) -> str:
    """The model as MuJoCo reads it."""
    made = truss.network
    bodies = []
    for joint, (place, held, numbers) in enumerate(
        zip(made.places, made.held, made.unknowns, strict=True)
    ):
        x, y, *rest = place.tolist()
        slides = "".join(
            f'<joint type="slide" axis="{" ".join("01"[k == axis] for k in range(3))}"/>'
            for axis, fast in enumerate(held)
            if not fast
        )
        free = numbers[~held]
        mass = float(masses[free[0]]) if len(free) else 0.0
        heavy = (
            f'<inertial pos="0 0 0" mass="{mass}" diaginertia="{mass} {mass} {mass}"/>'
            if len(free)
            else ""
        )
        place_text = f"{x} {y} {rest[0] if rest else 0.0}"
        bodies.append(f'<body pos="{place_text}">{heavy}{slides}<site name="s{joint}"/></body>')
    tendons = "".join(
        f'<spatial stiffness="1" damping="1" springlength="1">'
        f'<site site="s{first}"/><site site="s{second}"/></spatial>'
        for first, second in made.ends.tolist()
    )
    return document(step, "".join(bodies), tendons, "")
