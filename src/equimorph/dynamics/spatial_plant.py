"""A chain in space in MuJoCo: hinges about three axes at each joint, anchors that are moved.

An anchor's prescribed joints carry so much inertia that nothing but their own drive moves them:
the simulation knows how fast they move and that they will.
"""

import numpy as np

from equimorph.array_types import Float, Int
from equimorph.dynamics.mechanism import LIGHT, Settings, Vector
from equimorph.dynamics.simulation import Simulation
from equimorph.dynamics.spatial_chain import CLAMP_AXES, SpatialChain, cross
from equimorph.dynamics.writer import closing, document, inertial

IMMOVABLE = 1e3
"""Inertia of prescribed joints, relative to the rod's mass and length."""
TIP = 1.0
"""Inertia of a tip that is welded to its anchor, and its mass where its place is prescribed; with
0.01 the weld is less sharp, 8e-6 of the length in place of 2e-6."""


class SpatialPlant(Simulation):
    """A chain in space in MuJoCo; arguments as of `LinkagePlant`."""

    linkage: SpatialChain

    def __init__(self, chain: SpatialChain, step: float, damping: float) -> None:
        self.linkage, self._step, self._damping = chain, step, damping
        super().__init__(self._text())
        name = self._mujoco.mjtObj.mjOBJ_BODY
        self._bodies = [
            self._mujoco.mj_name2id(self.model, name, f"b{k}") for k in range(chain.links + 1)
        ]
        self._driven = np.flatnonzero(~chain.free)
        self._elastic = np.flatnonzero(chain.rigidity.any(axis=1))
        self._arm = np.array([chain.way * 0.5 * chain.length, 0.0, 0.0])

    # --- text -----------------------------------------------------------------------------------

    def _text(self) -> str:
        chain, reach = self.linkage, self.linkage.way * self.linkage.length
        mass, whole = 1.0 / chain.links, self._anchor(0)
        for link in range(chain.links):
            whole += f'<body name="b{link + 1}" pos="{reach if link else 0.0} 0 0">'
            whole += self._joints("hinge", chain.hinges[link + 1], chain.axes[link + 1])
            axes = chain.way * np.eye(3)[list(chain.slides)]
            whole += self._joints("slide", chain.gives[link], axes)
            whole += inertial(0.5 * reach, mass, mass * chain.length**2 / 12.0)
        end = f'<site name="end" pos="{reach} 0 0"/>'
        clamped = len(chain.hinges) > chain.links + 1
        if clamped:
            held = not chain.free[chain.moves : chain.moves + 3].any()
            tip = self._joints("hinge", chain.hinges[-1], chain.axes[-1])
            tip += inertial(0.0, TIP if held else LIGHT * mass, TIP)
            end = f'<body pos="{reach} 0 0">{tip}<site name="end"/></body>'
        whole += end + "</body>" * (chain.links + 1)
        if not chain.far:
            return document(self._step, whole, "", "")
        whole += self._anchor(chain.moves) + '<site name="anchor"/></body>'
        return document(
            self._step,
            whole,
            "",
            closing("weld" if clamped else "connect", "end", "anchor", self._step),
        )

    def _anchor(self, first: int) -> str:
        """Begin a body that slides along x, y and z and turns as a clamp does."""
        count = min(self.linkage.size - first, 6)
        name = "anchor" if first else "b0"
        out = f'<body name="{name}">' + self._joints("slide", first + np.arange(3), np.eye(3))
        out += self._joints("hinge", first + np.arange(3, count), CLAMP_AXES[: count - 3])
        mass = LIGHT / self.linkage.links
        return out + inertial(0.0, mass, mass * self.linkage.length**2)

    def _joints(
        self, kind: str, entries: Int[np.ndarray, " joints"], axes: Float[np.ndarray, "joints 3"]
    ) -> str:
        chain, out = self.linkage, ""
        for entry, axis in zip(entries, axes, strict=False):
            stiff = chain.rigidity[entry, -1]
            heavy = 0.0 if chain.free[entry] else IMMOVABLE
            out += (
                f'<joint type="{kind}" axis="{axis[0]} {axis[1]} {axis[2]}" armature="{heavy}" '
                f'stiffness="{stiff}" damping="{self._damping * stiff}"/>'
            )
        return out

    # --- motion ---------------------------------------------------------------------------------

    def start(self, v: Vector, y: Settings) -> None:
        """Place the chain at rest."""
        self._mujoco.mj_resetData(self.model, self.data)
        self.set(y)
        self.data.qpos[:] = self.linkage.prescribe(v, y)
        self._mujoco.mj_forward(self.model, self.data)

    def set(self, y: Settings) -> None:
        """Set the actuators and loads."""
        chain, some = self.linkage, self._elastic
        stiff = (chain.rigidity @ y)[some]
        self.model.jnt_stiffness.reshape(chain.size, -1)[some, 0] = stiff
        self.model.qpos_spring[some] = (chain.couples @ y)[some] / stiff
        self._targets = (chain.targets @ y)[self._driven]
        self._force, self._y = np.asarray(chain.forces @ y), y

    def step(self) -> None:
        """One step in time; loads act on the joints as they are at its start."""
        data, driven = self.data, self._driven
        rates = (self._targets - data.qpos[driven]) / self._step
        data.qfrc_applied[driven] = IMMOVABLE * (rates - data.qvel[driven]) / self._step
        self._mujoco.mj_step1(self.model, data)
        if self._force.any():
            data.xfrc_applied[self._bodies, :3] = self._force
            links = self._bodies[1:]
            arms = data.xmat[links].reshape(-1, 3, 3) @ self._arm
            data.xfrc_applied[links, 3:] = cross(arms, self._force[1:])
        self._mujoco.mj_step2(self.model, data)
        data.qpos[driven], data.qvel[driven] = self._targets, rates

    def entries(self, qpos: Float[np.ndarray, " joints"], y: Settings) -> Vector:
        """Entries of the chain: all joints of the simulation."""
        del y
        return qpos.copy()

    @property
    def kinetic(self) -> float:
        """Kinetic energy of the links."""
        rates = self.data.qvel
        return float(0.5 * rates @ self.linkage.mass(self.v) @ rates)
