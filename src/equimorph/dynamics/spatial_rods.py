"""Rods in space as chains: joints bend and twist as the rod does between the middles of links.

An anchor's prescribed joints carry so much inertia that nothing but their own drive moves them:
the simulation knows how fast they move and that they will.
"""

from collections.abc import Iterator

import numpy as np
from scipy.interpolate import CubicSpline

from equimorph.arrays import Float, Int
from equimorph.dynamics.mechanism import LIGHT, Settings, Vector
from equimorph.dynamics.plant import Chained, Simulation
from equimorph.dynamics.rods import (
    Function,
    between,
    holding_stiffness,
    integrals,
    joint_forces,
    thrust,
    time_of,
)
from equimorph.dynamics.spatial_chain import (
    ANCHOR,
    CLAMP_AXES,
    REST,
    STIFF,
    Axes,
    SpatialChain,
    cross,
)
from equimorph.dynamics.writer import closing, document, inertial
from equimorph.errors import InputError
from equimorph.structures import Curvature, SpatialRod, State, States, Tendon
from equimorph.structures.rod.any_description import Construction, construction
from equimorph.structures.rod.terms import Term
from equimorph.structures.rod.units import FOUR_PI_SQUARED
from equimorph.structures.spatial.ends import support_axes
from equimorph.structures.spatial.model import ANGLES, AXES, Build
from equimorph.structures.spatial.natural import on_orbit
from equimorph.structures.spatial.phase import PinnedMechanics
from equimorph.structures.spatial.quaternions import exponential, product

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
        return qpos.copy()

    @property
    def kinetic(self) -> float:
        """Kinetic energy of the links."""
        rates = self.data.qvel
        return float(0.5 * rates @ self.linkage.mass(self.v) @ rates)


Points = Float[np.ndarray, " points"]

TWIST, ASIDE, BEND = 0, 1, 2
"""Twist, bending about n, and about b, which is that in the plane of a planar rod."""


def spatial_chain(rod: SpatialRod, links: int) -> SpatialChain:
    """A rod of length 1 and mass 1 as N links, from the first end whose rotation is prescribed on.

    Lengths by L, forces by 4π²B/L². Half a link with twice the stiffness at each clamp, and
    hinges in alternating orders, make the chain accurate to second order.
    """
    made = construction(rod.description, len(rod.parameters))
    first, last = made.build.ends
    way = -1 if first.turns else 1
    near, far = (_anchor(made, side) for side in (0, 1)[::way])
    clamped = not (first.turns or last.turns)
    size = ANCHOR if clamped else 3 * bool(far[:, STIFF, -1].any())
    orders = np.array([(0, 1, 2), (2, 1, 0)])[np.arange(links + 1) % 2][::way, ::way]
    hinges = np.take_along_axis(_hinges(made, links)[::way], orders[..., None, None], axis=1)
    gives = _slides(made, links)[::way]
    slides = np.flatnonzero(np.isfinite(gives[0, :, STIFF, -1]))
    inner = np.concatenate([hinges[:links], gives[:, slides]], axis=1)
    parts = [near, inner.reshape(-1, *near.shape[1:]), *hinges[links:][:clamped], far[:size]]
    return SpatialChain(
        way,
        orders[: links + clamped],
        tuple(slides.tolist()),
        size,
        np.concatenate(parts),
        joint_forces(made, np.linspace(0.0, 1.0, links + 1), made.build.mesh.breaks)[::way],
    )


def _anchor(made: Construction[Build], side: int) -> Float[np.ndarray, "6 2 settings"]:
    """Places along x, y and z, and the angles of a clamp; what is held has the stiffness ∞."""
    end = made.build.ends[side]
    out = np.zeros((ANCHOR, 2, made.table.shape[1]))
    for k, axis in enumerate(support_axes(made.build.ends)):
        out[k, STIFF, -1] = holding_stiffness((axis.first, axis.last)[side])
        if axis.opposed and side == 1:
            out[k, REST] = made.row(axis.name)
    if not end.turns:
        out[3:, STIFF, -1] = np.inf
        out[3:, REST] = [made.row(f"{angle}_{'AB'[side]}") for angle in ANGLES]
    return out


def _stiffnesses(build: Build) -> tuple[Function, Function, Function]:
    """K(s) against twist and bending about n and b."""
    twist, aside = (each.density for each in build.ratios)

    def plane(s: Points) -> Points:
        return np.asarray(build.stiffness.density(s) / FOUR_PI_SQUARED)

    return lambda s: plane(s) * twist(s), lambda s: plane(s) * aside(s), plane


def _hinges(made: Construction[Build], links: int) -> Float[np.ndarray, "joints 3 2 settings"]:
    """Twist and bending about n and b at the joints, with half a cell at each end."""
    build, breaks = made.build, made.build.mesh.breaks
    cells = np.concatenate([[0.0], (np.arange(links) + 0.5) / links, [1.0]])
    out = np.zeros((links + 1, 3, 2, made.table.shape[1]))
    stiff = _stiffnesses(build)

    def whole(density: Function) -> Float[np.ndarray, " cells"]:
        return integrals(density, cells, breaks)

    for k, (stiffness, natural) in enumerate(zip(stiff, build.natural, strict=True)):
        out[:, k, STIFF, -1] = 1.0 / whole(_inverse(stiffness))
        out[:, k, REST, -1] = whole(natural.density)
    for name, terms in build.terms.items():
        row = made.row(name)
        for term in terms:
            for k, turn in _turns(term, stiff):
                out[:, k, REST] += np.outer(whole(turn), row)
            if isinstance(term, Tendon):
                arm = whole(_stiffening(term)) / (np.diff(cells) ** 2 * build.length)
                out[:, TWIST, STIFF] += np.outer(arm, row)
    return out


def _turns(
    term: Term, stiff: tuple[Function, Function, Function]
) -> Iterator[tuple[int, Function]]:
    """Axes and turns per arclength that a term of amplitude 1 gives a rod without moment."""
    if isinstance(term, Curvature):
        pattern = term.profile().density
        yield AXES.index(term.about), lambda s: between(s, term.start, term.stop) * pattern(s)
    if isinstance(term, Tendon):
        left, aside = (each.density for each in term.profiles())
        yield BEND, lambda s: between(s, term.start, term.stop) * left(s) / stiff[BEND](s)
        yield ASIDE, lambda s: -between(s, term.start, term.stop) * aside(s) / stiff[ASIDE](s)


def _inverse(stiffness: Function) -> Function:
    return lambda s: 1.0 / stiffness(s)


def _stiffening(term: Tendon) -> Function:
    """d², by which a cable at distance d stiffens the rod against twist."""
    left, aside = (each.density for each in term.profiles())
    return lambda s: between(s, term.start, term.stop) * (left(s) ** 2 + aside(s) ** 2)


def _slides(made: Construction[Build], links: int) -> Float[np.ndarray, "links 3 2 settings"]:
    """Extension of the links and their shear along n and b; ∞ where they do not give."""
    build, breaks, nodes = made.build, made.build.mesh.breaks, np.linspace(0.0, 1.0, links + 1)
    out = np.zeros((links, 3, 2, made.table.shape[1]))
    out[:, :, STIFF, -1] = np.inf
    for k, each in enumerate((build.axial, *(build.shear or (None, None)))):
        if each is not None:
            out[:, k, STIFF, -1] = 1.0 / integrals(_inverse(each.density), nodes, breaks)
    for name, terms in build.terms.items():
        for term in terms:
            if isinstance(term, Tendon) and build.axial is not None:
                shorter = integrals(thrust(term, build.axial), nodes, breaks) * build.length
                out[:, 0, REST] -= np.outer(shorter, made.row(name))
    return out


def check_isolated(rod: SpatialRod, start: State, simulator: str) -> None:
    """Refuse states that may be turned about the axis of the clamps for nothing.

    Such are states of orbits, and all of a rod with a phase condition.
    """
    mechanics = rod.mechanics
    pinned = isinstance(mechanics, PinnedMechanics)
    if pinned or on_orbit(mechanics, start.z[None], start.p[None])[0]:
        raise InputError(
            f"`simulator` must cover the rod; got {simulator!r} for a state of an orbit, which may "
            "turn about the axis of the clamps for nothing. Give the bending stiffnesses different "
            "values, or the rod a load across the axis."
        )


class ChainedSpatialRod(Chained):
    """A rod in space and its chain."""

    linkage: SpatialChain

    def __init__(self, rod: SpatialRod, links: int) -> None:
        self.structure, self._rod, self.links = rod, rod, links
        self.time = time_of(rod)
        self.linkage = spatial_chain(rod, links)
        self.length, self.energy = rod.units.value("length"), rod.energy_scale
        self._middles = (np.arange(links) + 0.5) / links
        self._joints = np.linspace(0.0, 1.0, links + 1)

    def places(self, states: States) -> Float[np.ndarray, "lanes members joints 3"]:
        """Places at the ends of links, in the structure's unit of length."""
        return self._rod.places(states.z, states.p, self._joints)[:, None]

    def entries(self, state: State) -> Vector:
        """Angles of the hinges between the rod's rotations at the middles of links, and slides."""
        chain, recovery = self.linkage, self._rod.recovery
        v = chain.prescribe(np.zeros(chain.size), np.append(state.p, 1.0))
        joints = recovery.at(state.z[None], state.p[None], self._joints).places[0]
        frames = recovery.at(state.z[None], state.p[None], self._middles).frames[0]
        pose = chain.pose(v)
        bodies = np.concatenate([pose.frames[:1], frames[:: chain.way], pose.clamp[None]])
        bodies = bodies[: len(chain.hinges)]
        turns = np.swapaxes(bodies[:-1], 1, 2) @ bodies[1:]
        v[chain.hinges[1:]] = hinge_angles(chain.axes[1:], turns)
        ends = joints[[0, -1]][:: chain.way]
        v[:3] = ends[0]
        if chain.far:
            v[chain.moves : chain.moves + 3] = ends[1]
        steps = np.einsum("lyx,ly->lx", frames, np.diff(joints, axis=0))
        steps[:, 0] -= chain.length
        v[chain.gives] = steps[:: chain.way, chain.slides]
        return v

    def unknowns(self, v: Vector) -> Float[np.ndarray, " size"]:
        """Quaternions at the rod's nodes, by a spline through those of the links and clamps."""
        chain, mechanics = self.linkage, self._rod.mechanics
        q, found = np.array([1.0, 0.0, 0.0, 0.0]), []
        for axes, angles in zip(chain.axes, v[chain.hinges], strict=True):
            for axis, angle in zip(axes, angles, strict=True):
                q = product(q, exponential(angle * axis))
            found.append(q)
        s = np.concatenate([[0.0], self._middles, [1.0]])[: len(found)]
        if chain.way < 0:
            s, found = (1.0 - s)[::-1], found[::-1]
        nodes = mechanics.mesh.nodes[mechanics.model.unknown_nodes]
        rotations = CubicSpline(s, np.array(found))(nodes)
        out = np.zeros(mechanics.size)
        unit = rotations / np.linalg.norm(rotations, axis=1, keepdims=True)
        out[: mechanics.unknowns] = unit.ravel()
        return out

    def simulation(self, step: float, damping: float) -> Simulation:
        """The chain in MuJoCo."""
        return SpatialPlant(self.linkage, step, damping)


def hinge_angles(axes: Axes, turns: Axes) -> Float[np.ndarray, "joints 3"]:
    """Angles (α, β, γ) of ``exp(α a₁) exp(β a₂) exp(γ a₃)`` about three axes at right angles."""
    hand = np.linalg.det(axes)
    local = np.einsum("jax,jxy,jby->jab", axes, turns, axes)
    first = np.arctan2(-hand * local[:, 1, 2], local[:, 2, 2])
    second = np.arcsin(np.clip(hand * local[:, 0, 2], -1.0, 1.0))
    third = np.arctan2(-hand * local[:, 0, 1], local[:, 0, 0])
    return np.stack([first, second, third], axis=1)
