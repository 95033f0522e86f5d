"""A linkage in MuJoCo: an independent simulation of rigid bodies, joints and constraints.

See docs/time.md for the model, and docs/decisions.md, "A replay is a chain of rigid links in
MuJoCo, with its own statics beside it".

`Chained` says how the entries of a mechanism and the unknowns of a structure correspond.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from equimorph.arrays import Bool, Float, Int
from equimorph.dynamics.linkage import Linkage
from equimorph.dynamics.mechanism import Mechanism, Settings, Vector
from equimorph.dynamics.tree import WORLD, tree_of
from equimorph.dynamics.writer import Writer
from equimorph.errors import load_package
from equimorph.structures import State, States, Structure


def mujoco_module() -> Any:
    """MuJoCo, which only a replay needs; see `load_package`."""
    otherwise = ', or choose simulator="own", which is not independent'
    return load_package("mujoco", "replay", "simulator", otherwise)


class Simulation(ABC):
    """A mechanism that moves in MuJoCo under settings that change in time."""

    linkage: Mechanism
    _y: Settings | None = None

    def __init__(self, text: str) -> None:
        self._mujoco = mujoco_module()
        self.model: Any = self._mujoco.MjModel.from_xml_string(text)
        self.data: Any = self._mujoco.MjData(self.model)

    @abstractmethod
    def start(self, v: Vector, y: Settings) -> None:
        """Place the mechanism at rest."""

    @abstractmethod
    def set(self, y: Settings) -> None:
        """Set the actuators and loads."""

    @abstractmethod
    def step(self) -> None:
        """One step in time."""

    @abstractmethod
    def entries(self, qpos: Float[np.ndarray, " joints"], y: Settings) -> Vector:
        """Entries of the mechanism; places of nodes that members carry are theirs."""

    @property
    def v(self) -> Vector:
        """Entries of the mechanism as it is."""
        assert self._y is not None
        return self.entries(self.data.qpos, self._y)

    @property
    @abstractmethod
    def kinetic(self) -> float:
        """Kinetic energy."""

    @property
    def closure(self) -> float:
        """Largest distance by which a loop is open, relative to the unit of length."""
        return float(np.abs(self.linkage.closure(self.v)).max(initial=0.0))

    @property
    def speed(self) -> float:
        """Largest rate of a joint."""
        return float(np.abs(self.data.qvel).max(initial=0.0))


@dataclass(frozen=True, eq=False)
class _Drive:
    """Numbers of the model, or loads, that are a table times the settings."""

    into: np.ndarray
    at: Int[np.ndarray, " numbers"]
    table: Float[np.ndarray, "numbers settings"]

    @classmethod
    def of(cls, into: np.ndarray, at: Any, table: Float[np.ndarray, "... settings"]) -> "_Drive":
        """Part of an array, of the shape of the table without its last axis."""
        number = np.arange(into.size).reshape(into.shape)[at].ravel()
        return cls(into.reshape(-1), number, table.reshape(len(number), table.shape[-1]))

    def by(self, settings: Bool[np.ndarray, " settings"]) -> "_Drive":
        """Those that some of the settings change."""
        some = self.table[:, settings].any(axis=1)
        return _Drive(self.into, self.at[some], self.table[some])


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
        self._drag, self._step = writer.drag(), step
        self._dragged: Vector | None = None
        self._hinge = np.array([writer.hinge[k] for k in range(len(self.tree.bodies))])
        self._hinged = np.flatnonzero(self._hinge >= 0)
        self._moved = self._hinge[self._hinged]
        self._carried = np.ascontiguousarray(self.tree.above[:, self._hinged])
        self._slides, self._stretches = writer.slides, writer.stretches
        self._floats = writer.floats
        self._loaded = bool(linkage.forces.any() or linkage.node_forces.any())
        self._loaded |= bool(linkage.couples.any() or linkage.pressure.any())
        self._standing = self._standing_places()
        self._shifts = bool(self._standing[..., :-1].any())
        self._rate = self._next_rate = np.zeros((len(self._hinge), 2))
        self._force, self._couple = np.zeros((len(self._hinge), 2)), np.zeros(len(self._hinge))
        self._total = np.zeros(len(self._floats))
        self._pushed = np.array([at for at, _, _ in self._floats], dtype=int)
        self._drives = self._find_drives(writer)
        self._changing: dict[bytes, list[_Drive]] = {}
        self._qpos, self._applied = self.data.qpos, self.data.qfrc_applied

    def _standing_places(self) -> Float[np.ndarray, "bodies 2 settings"]:
        """Where the support holds on which each body, and all that carries it, stands, or 0."""
        tree, linkage = self.tree, self.linkage
        held = np.isinf(linkage.supports.stiffness)[..., None] * linkage.supports.places
        places = np.einsum("nas,nax->nxs", held, linkage.supports.axes)
        out = np.zeros((len(tree.bodies), *places.shape[1:]))
        for k, body in enumerate(tree.bodies):
            if body.base >= 0:
                out[tree.above[:, k] > 0.0] = places[body.base]
        return out

    @cached_property
    def _masses(self) -> Float[np.ndarray, " bodies"]:
        """Masses of the bodies."""
        flat, node = self.linkage.masses.ravel(), self.linkage.node_mass
        return np.array([flat[b.link] if b.link >= 0 else node for b in self.tree.bodies])

    def _find_drives(self, writer: Writer) -> list[_Drive]:
        """All that the settings change: rests of springs, places of supports, loads."""
        model, linkage, tree = self.model, self.linkage, self.tree
        couples = np.zeros((len(tree.bodies), linkage.couples.shape[1]))
        turning = tree.entries >= 0
        couples[turning] = linkage.couples[tree.entries[turning]]
        total = [tree.floating[body][axis] for _, body, axis in self._floats]
        out = [_Drive.of(self._force, ..., tree.forces), _Drive.of(self._couple, ..., couples)]
        if total:
            out.append(_Drive.of(self._total, ..., np.array(total)))
        fields = (model.qpos_spring[:, None], model.tendon_lengthspring)
        for field, springs in zip(fields, writer.springs(), strict=True):
            if springs:
                at = np.array([each.at for each in springs])
                rest = np.array([each.rest for each in springs])
                out.append(_Drive.of(field, at, rest[:, None].repeat(field.shape[1], axis=1)))
        held = np.isinf(linkage.supports.stiffness)[..., None] * linkage.supports.places
        places = np.einsum("nas,nax->nxs", held, linkage.supports.axes)
        standing = [(f"b{k}", body.base) for k, body in enumerate(tree.bodies) if body.base >= 0]
        worlds = [(f"w{node}", node) for node in range(linkage.nodes)]
        for kind, field, named in (
            ("mjOBJ_BODY", model.body_pos, standing), ("mjOBJ_SITE", model.site_pos, worlds),
        ):  # fmt: skip
            at = np.array([self._number(kind, name) for name, _ in named], dtype=int)
            nodes = np.array([node for _, node in named], dtype=int)[at >= 0]
            out.append(_Drive.of(field, (at[at >= 0], slice(2)), places[nodes]))
        return out

    # --- state ----------------------------------------------------------------------------------

    def _number(self, kind: str, name: str) -> int:
        """Number of a named body or site of the simulation; −1 without one."""
        return int(self._mujoco.mj_name2id(self.model, getattr(self._mujoco.mjtObj, kind), name))

    def start(self, v: Vector, y: Settings) -> None:
        """Place the linkage at rest."""
        data, bodies = self.data, self.tree.bodies
        self._mujoco.mj_resetData(self.model, data)
        self.set(y)
        self._dragged, self._rate = None, np.zeros_like(self._rate)
        self._next_rate = self._rate
        angles = self.tree.angles(v)
        for k, body in enumerate(bodies):
            if self._hinge[k] >= 0:
                carried = 0.0 if body.parent == WORLD else angles[body.parent]
                data.qpos[self._hinge[k]] = angles[k] - carried
        for at, entry in self._slides:
            data.qpos[at] = v[entry]
        for at, entry, link in self._stretches:
            data.qpos[at] = v[entry] * self.linkage.lengths.ravel()[link]
        for at, k, axis in self._floats:
            member, link = divmod(bodies[k].link, self.linkage.lengths.shape[1])
            data.qpos[at] = self.linkage.places(v)[member, link, axis]
        self._mujoco.mj_forward(self.model, data)

    def set(self, y: Settings) -> None:
        """Set the actuators and loads."""
        drives = self._drives
        if self._y is not None:
            self._dragged = self._drag @ (y - self._y) / self._step
            if self._shifts:
                self._next_rate = self._standing @ (y - self._y) / self._step
            moves = y != self._y
            key = moves.tobytes()
            if key not in self._changing:
                some = [each.by(moves) for each in self._drives]
                self._changing[key] = [each for each in some if len(each.at)]
            drives = self._changing[key]
        for drive in drives:
            drive.into[drive.at] = drive.table @ y
        self._y = y.copy()

    def step(self) -> None:
        """One step in time; supports that moved since the last one carry their dampers.

        They accelerate what stands on them, whose coordinates are relative to them: forces of
        inertia act, impulses where the rate jumps.
        """
        self._applied[:] = 0.0 if self._dragged is None else self._dragged
        self._dragged = None
        if self._loaded or self._shifts:
            self._apply()
        self._rate, self._next_rate = self._next_rate, np.zeros_like(self._rate)
        self._mujoco.mj_step(self.model, self.data)

    def _apply(self) -> None:
        """Generalised forces of the loads: ``Q = Σ R × d`` of what each joint carries."""
        applied, sizes = self._applied, self._sizes()
        angles = self._carried @ self._qpos[self._moved]
        c, s = np.cos(angles), np.sin(angles)
        force, total = self._force, self._total
        across = force
        if self._side is not None or self._shifts:  # on every link a force in its middle
            own = (self._rate - self._next_rate) * (self._masses / self._step)[:, None]
            if self._side is not None:
                own += (sizes * (self._side @ self._y))[:, None] * np.stack([-s, c], axis=1)
            force = force + self.tree.levers.T @ own
            across = force - 0.5 * own
            carried = [self.tree.above[:, k] @ own[:, axis] for _, k, axis in self._floats]
            total = total + np.array(carried)
        turn = sizes * (c * across[:, 1] - s * across[:, 0]) + self._couple
        applied[self._moved] += turn @ self._carried
        applied[self._pushed] += total
        for at, entry in self._slides:
            node, axis = divmod(entry, 2)
            body = self._body_of_node[node]
            applied[at] += force[body] @ self.linkage.supports.axes[node, axis]
        for at, _, link in self._stretches:
            body = self._body_of_link[link]
            applied[at] += c[body] * force[body, 0] + s[body] * force[body, 1]

    @cached_property
    def _side(self) -> Float[np.ndarray, "bodies settings"] | None:
        """Pressure on each body towards its left, by the settings; None without one."""
        linkage, tree = self.linkage, self.tree
        if not linkage.pressure.any():
            return None
        member = [max(body.link, 0) // linkage.lengths.shape[1] for body in tree.bodies]
        left = np.where(tree.offsets > 0.0, -1.0, 1.0)
        return np.asarray(left[:, None] * linkage.pressure[member])

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

    def entries(self, qpos: Float[np.ndarray, " joints"], y: Settings) -> Vector:
        """Entries of the linkage; places of nodes that members carry are theirs."""
        linkage, tree = self.linkage, self.tree
        out = linkage.prescribe(np.zeros(linkage.size), y)
        angles = self._carried @ qpos[self._moved] - tree.offsets
        turning = tree.entries >= 0
        out[tree.entries[turning]] = angles[turning]
        for at, entry in self._slides:
            out[entry] = qpos[at]
        flat = linkage.lengths.ravel()
        for at, entry, link in self._stretches:
            out[entry] = qpos[at] / flat[link]
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


class Chained(ABC):
    """A structure as chains of links, and how their entries and its unknowns correspond."""

    structure: Structure
    linkage: Mechanism
    links: int
    """Links of each chain."""
    length: float
    energy: float
    time: float = 1.0
    """Length, energy and time of the chain in the structure's units."""

    @abstractmethod
    def entries(self, state: State) -> Vector:
        """Entries of the mechanism next to a state; prescribed ones are set later."""

    @abstractmethod
    def simulation(self, step: float, damping: float) -> Simulation:
        """The mechanism in MuJoCo."""

    @abstractmethod
    def places(self, states: States) -> Float[np.ndarray, "lanes members joints space"]:
        """Places at the ends of links, in the structure's unit of length."""

    @abstractmethod
    def unknowns(self, v: Vector) -> Float[np.ndarray, " size"]:
        """Unknowns of the structure; multipliers 0."""


class PlanarChained(Chained):
    """A planar structure as a linkage."""

    linkage: Linkage

    @abstractmethod
    def angles(self, state: State) -> Float[np.ndarray, "members links"]:
        """Angles at the middles of the links."""

    @abstractmethod
    def turns(self, state: State) -> Float[np.ndarray, " nodes"]:
        """Turns of the nodes."""

    @abstractmethod
    def node_places(self, state: State) -> Float[np.ndarray, "nodes 2"]:
        """Places of the nodes, in units of the linkage."""

    def entries(self, state: State) -> Vector:
        """Places of nodes along their axes, turns, angles and strains."""
        linkage = self.linkage
        v = np.zeros(linkage.size)
        places = self.node_places(state)
        v[: 2 * linkage.nodes] = np.einsum("nx,nax->na", places, linkage.supports.axes).ravel()
        v[linkage.turn_entries] = self.turns(state)
        v[linkage.angle_entries] = self.angles(state)
        joints = self.places(state.batch)[0] / self.length
        sizes = np.linalg.norm(np.diff(joints, axis=1), axis=2)
        stretch = np.isfinite(linkage.axial)
        v[linkage.strain_entries] = np.where(stretch, sizes / linkage.lengths - 1.0, 0.0)
        return v

    def simulation(self, step: float, damping: float) -> Simulation:
        """The linkage in MuJoCo."""
        return LinkagePlant(self.linkage, step, damping)
