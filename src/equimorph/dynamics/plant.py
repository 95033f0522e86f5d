"""A linkage in MuJoCo: an independent simulation of rigid bodies, joints and constraints.

See docs/time.md for the model, and docs/decisions.md for what was measured.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from equimorph.array_types import Bool, Float, Int
from equimorph.dynamics.linkage import Linkage
from equimorph.dynamics.mechanism import Settings, Vector
from equimorph.dynamics.simulation import Simulation
from equimorph.dynamics.tree import WORLD, tree_of
from equimorph.dynamics.writer import Spring, Writer

Angles = Float[np.ndarray, " bodies"]


@dataclass(frozen=True, eq=False)
class _Rests:
    """Where all joints, or all tendons, are at rest; those that the settings change come first."""

    at: Int[np.ndarray, " springs"]
    rest: Float[np.ndarray, "springs settings"]
    driven: int

    @classmethod
    def of(cls, springs: list[Spring]) -> "_Rests":
        order = sorted(springs, key=lambda each: not each.rest[:-1].any())
        at = np.array([each.at for each in order], dtype=int)
        driven = sum(bool(each.rest[:-1].any()) for each in order)
        rest = np.array([each.rest for each in order]) if order else np.zeros((0, 0))
        return cls(at, rest, driven)

    def write(self, into: np.ndarray, y: Settings, again: bool) -> None:
        """Write them into a field of the model; the constant ones only once."""
        count = self.driven if again else len(self.at)
        if count:
            values = self.rest[:count] @ y
            into[self.at[:count]] = values if into.ndim == 1 else values[:, None]


class LinkagePlant(Simulation):
    """A linkage that moves in MuJoCo under settings that change in time.

    Parameters
    ----------
    linkage
        What moves; units of its own.
    step
        Step in time.
    damping
        Damping of every elastic joint over its stiffness.
    """

    linkage: Linkage

    def __init__(self, linkage: Linkage, step: float, damping: float) -> None:
        self.linkage, self.tree = linkage, tree_of(linkage)
        writer = Writer(self.tree, step, damping)
        super().__init__(writer.text())
        self._springs = tuple(_Rests.of(each) for each in writer.springs())
        self._drag, self._step = writer.drag(), step
        self._dragged: Vector | None = None
        self._hinge = np.array([writer.hinge[k] for k in range(len(self.tree.bodies))])
        self._hinged = np.flatnonzero(self._hinge >= 0)
        self._moved = self._hinge[self._hinged]
        self._carried = np.ascontiguousarray(self.tree.above[:, self._hinged])
        self._slides, self._stretches = writer.slides, writer.stretches
        self._couples = np.zeros((len(self.tree.bodies), linkage.couples.shape[1]))
        turning = self.tree.entries >= 0
        self._couples[turning] = linkage.couples[self.tree.entries[turning]]
        self._loaded = bool(self.tree.forces.any() or self._couples.any())
        self._pressed = bool(linkage.pressure.any())
        self._forces = self.tree.forces
        self._y: Settings | None = None

    # --- state ----------------------------------------------------------------------------------

    def _number(self, kind: str, name: str) -> int:
        """Number of a named body or site of the simulation; −1 without one."""
        return int(self._mujoco.mj_name2id(self.model, getattr(self._mujoco.mjtObj, kind), name))

    @cached_property
    def _anchors(self) -> list[tuple[int, int]]:
        """Bodies of the simulation that stand in the world, and their nodes."""
        bodies = enumerate(self.tree.bodies)
        return [(self._number("mjOBJ_BODY", f"b{k}"), b.base) for k, b in bodies if b.base >= 0]

    @cached_property
    def _sites(self) -> list[tuple[int, int]]:
        """Sites fixed in the world at which loops are closed, and their nodes."""
        found = [(self._number("mjOBJ_SITE", f"w{k}"), k) for k in range(self.linkage.nodes)]
        return [each for each in found if each[0] >= 0]

    def start(self, v: Vector, y: Settings) -> None:
        """Place the linkage at rest."""
        data, bodies = self.data, self.tree.bodies
        self._mujoco.mj_resetData(self.model, data)
        self.set(y)
        self._dragged = None
        angles = self.tree.angles(v)
        for k, body in enumerate(bodies):
            if self._hinge[k] >= 0:
                carried = 0.0 if body.parent == WORLD else angles[body.parent]
                data.qpos[self._hinge[k]] = angles[k] - carried
        for at, entry in self._slides:
            data.qpos[at] = v[entry]
        for at, entry, link in self._stretches:
            data.qpos[at] = v[entry] * self.linkage.lengths.ravel()[link]
        self._mujoco.mj_forward(self.model, data)

    def set(self, y: Settings) -> None:
        """Set the actuators and loads."""
        if self._y is not None and np.array_equal(y, self._y):
            return
        model, linkage = self.model, self.linkage
        joints, tendons = self._springs
        again = self._y is not None
        self._dragged = self._drag @ (y - self._y) / self._step if self._y is not None else None
        joints.write(model.qpos_spring, y, again)
        tendons.write(model.tendon_lengthspring, y, again)
        held = np.where(np.isinf(linkage.supports.stiffness), linkage.supports.places @ y, 0.0)
        for at, node in self._anchors:
            model.body_pos[at, :2] = held[node] @ linkage.supports.axes[node]
        for site, node in self._sites:
            model.site_pos[site, :2] = held[node] @ linkage.supports.axes[node]
        self._force = self._forces @ y
        self._couple = self._couples @ y
        self._y = y.copy()

    def step(self) -> None:
        """One step in time; supports that moved since the last one carry their dampers."""
        self.data.qfrc_applied[:] = 0.0 if self._dragged is None else self._dragged
        self._dragged = None
        if self._loaded or self._pressed:
            self._apply()
        self._mujoco.mj_step(self.model, self.data)

    def _apply(self) -> None:
        """Generalised forces of the loads: ``Q = Σ R × d`` of what each joint carries."""
        data, angles = self.data, self._angles()
        c, s = np.cos(angles), np.sin(angles)
        sizes = self._sizes()
        force = self._force
        turn = sizes * (c * force[:, 1] - s * force[:, 0]) + self._couple
        if self._pressed:
            turn, force = self._press(angles, sizes, turn, force)
        data.qfrc_applied[self._moved] += turn @ self._carried
        for at, entry in self._slides:
            node, axis = divmod(entry, 2)
            body = self._body_of_node[node]
            data.qfrc_applied[at] += force[body] @ self.linkage.supports.axes[node, axis]
        for at, _, link in self._stretches:
            body = self._body_of_link[link]
            data.qfrc_applied[at] += c[body] * force[body, 0] + s[body] * force[body, 1]

    def _press(
        self, angles: Angles, sizes: Angles, turn: Angles, force: Float[np.ndarray, "bodies 2"]
    ) -> tuple[Angles, Float[np.ndarray, "bodies 2"]]:
        """Add pressure: on every link a force in its middle, to the left of its member."""
        links = self.linkage.lengths.shape[1]
        pressure = self.linkage.pressure @ self._y
        member = np.array([max(body.link, 0) // links for body in self.tree.bodies])
        side = np.where(self.tree.offsets > 0.0, -1.0, 1.0)
        size = pressure[member] * sizes * side
        own = size[:, None] * np.stack([-np.sin(angles), np.cos(angles)], axis=1)
        carried = self.tree.above.T @ own
        beyond = carried - 0.5 * own
        c, s = np.cos(angles), np.sin(angles)
        return turn + sizes * (c * beyond[:, 1] - s * beyond[:, 0]), force + carried

    def _angles(self) -> Float[np.ndarray, " bodies"]:
        return np.asarray(self._carried @ self.data.qpos[self._moved])

    def _sizes(self) -> Float[np.ndarray, " bodies"]:
        if not self._stretches:
            return self.tree.sizes
        out = self.tree.sizes.copy()
        for at, _, link in self._stretches:
            out[self._body_of_link[link]] += self.data.qpos[at]
        return out

    @cached_property
    def _body_of_link(self) -> dict[int, int]:
        return {body.link: k for k, body in enumerate(self.tree.bodies) if body.link >= 0}

    @cached_property
    def _body_of_node(self) -> dict[int, int]:
        return {body.node: k for k, body in enumerate(self.tree.bodies) if body.node >= 0}

    @property
    def v(self) -> Vector:
        """Entries of the linkage; places of nodes that members carry are theirs."""
        linkage, tree = self.linkage, self.tree
        assert self._y is not None
        out = linkage.prescribe(np.zeros(linkage.size), self._y)
        angles = self._angles() - tree.offsets
        turning = tree.entries >= 0
        out[tree.entries[turning]] = angles[turning]
        for at, entry in self._slides:
            out[entry] = self.data.qpos[at]
        flat = linkage.lengths.ravel()
        for at, entry, link in self._stretches:
            out[entry] = self.data.qpos[at] / flat[link]
        return self._place_carried_nodes(out)

    def _place_carried_nodes(self, v: Vector) -> Vector:
        """Set the coordinates of nodes without support by the members that carry them."""
        linkage = self.linkage
        stands: Bool[np.ndarray, " nodes"] = np.asarray(linkage.supports.stiffness.any(axis=1))
        while not stands.all():
            for start, end, links in zip(
                *linkage.ends.T, linkage.links(v).sum(axis=1), strict=True
            ):
                places = linkage.node_places(v)
                if stands[start] and not stands[end]:
                    at, place = end, places[start] + links
                elif stands[end] and not stands[start]:
                    at, place = start, places[end] - links
                else:
                    continue
                v[2 * at : 2 * at + 2] = linkage.supports.axes[at] @ place
                stands[at] = True
        return v

    @property
    def kinetic(self) -> float:
        """Kinetic energy."""
        self._mujoco.mj_energyVel(self.model, self.data)
        return float(self.data.energy[1])
