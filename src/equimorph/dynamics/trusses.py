"""Trusses in MuJoCo: point masses, and spatial tendons whose rest lengths the actuators change."""

from typing import Any

import numpy as np

from equimorph.array_types import Float
from equimorph.arrays import Lanes, Parameters
from equimorph.dynamics.direct import DirectModel, DirectPlant
from equimorph.dynamics.model import Plant, Row
from equimorph.dynamics.simulation import mujoco_module
from equimorph.dynamics.writer import document
from equimorph.errors import InputError
from equimorph.structures import State, Truss


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
