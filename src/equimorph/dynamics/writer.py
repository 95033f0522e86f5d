"""A tree of rigid bodies as the text that MuJoCo reads."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from equimorph.arrays import Float
from equimorph.dynamics.tree import WORLD, Tree

Rests = Float[np.ndarray, "2 settings"]
"""`Spring.rest` and `Spring.held`."""
SOLVER_STEPS = 50
"""Most iterations of the constraint solver."""


@dataclass(frozen=True, eq=False)
class Spring:
    """A joint or tendon of the simulation that bends.

    at: its number; rest: where it is at rest, by setting; held: the part of that which supports
    prescribe.
    """

    at: int
    stiffness: float
    rest: Float[np.ndarray, " settings"]
    held: Float[np.ndarray, " settings"]


class Hinge(NamedTuple):
    """An elastic joint that is the hinge of a body."""

    stiffness: float
    rests: Rests


class Tendon(NamedTuple):
    """An elastic joint that a tendon replaces: its angle in turns of the bodies, and its spring."""

    row: np.ndarray
    spring: Spring


def document(step: float, world: str, tendons: str, closed: str) -> str:
    """XML of a model: bodies, tendons, and the equalities that close its loops."""
    return (
        '<mujoco><compiler angle="radian" autolimits="true"/>'
        f'<option timestep="{step}" integrator="discrete" gravity="0 0 0" '
        f'solver="Newton" iterations="{SOLVER_STEPS}" tolerance="1e-12">'
        '<flag contact="disable" refsafe="disable"/></option>'
        f"<worldbody>{world}</worldbody><tendon>{tendons}</tendon>"
        f"<equality>{closed}</equality></mujoco>"
    )


def closing(kind: str, first: str, second: str, step: float) -> str:
    """A connection, or a weld, of two sites, as sharp as the step allows."""
    return (
        f'<{kind} site1="{first}" site2="{second}" '
        f'solref="{2.0 * step} 1" solimp="0.9999 0.9999 0.001 0.5 2"/>'
    )


def inertial(centre: float, mass: float, inertia: float) -> str:
    """Mass of a body, with the same inertia about all axes."""
    return (
        f'<inertial pos="{centre} 0 0" mass="{mass}" diaginertia="{inertia} {inertia} {inertia}"/>'
    )


class Writer:
    """The model as MuJoCo reads it."""

    def __init__(self, tree: Tree, step: float, damping: float) -> None:
        self.tree, self.step, self.damping = tree, step, damping
        self.linkage = tree.linkage
        self.hinge: dict[int, int] = {}
        self.slides: list[tuple[int, int]] = []
        self.floats: list[tuple[int, int, int]] = []
        self.stretches: list[tuple[int, int, int]] = []
        self.joint_springs: list[Spring] = []
        self._joints = 0
        self._size = float(self.linkage.lengths.min())
        self._none = np.zeros((2, self.linkage.couples.shape[1]))
        self._parts = self._bends()

    def text(self) -> str:
        """XML of the whole model."""
        children: dict[int, list[int]] = {}
        for k, body in enumerate(self.tree.bodies):
            children.setdefault(body.parent, []).append(k)
        bodies = "".join("".join(self._body(k, children)) for k in children.get(WORLD, []))
        worlds = {node for _, node in self.tree.closed} - {
            body.node for body in self.tree.bodies if body.node >= 0
        }
        # a site at its body's origin would stay there: MuJoCo then never reads its place
        sites = "".join(f'<site name="w{node}" pos="1 1 0"/>' for node in sorted(worlds))
        close = "".join(
            closing("connect", f"e{body}", f"{'w' if node in worlds else 'n'}{node}", self.step)
            for body, node in self.tree.closed
        )
        return document(self.step, sites + bodies, self._tendons(), close)

    # --- bodies ---------------------------------------------------------------------------------

    def _body(self, k: int, children: dict[int, list[int]]) -> Iterator[str]:
        body, tree = self.tree.bodies[k], self.tree
        carried = 0.0 if body.parent == WORLD or body.at_start else tree.sizes[body.parent]
        yield f'<body name="b{k}" pos="{carried} 0 0">'
        if body.link < 0:
            yield from self._node(k)
        else:
            yield from self._link(k)
        for child in children.get(k, []):
            yield from self._body(child, children)
        yield "</body>"

    def _node(self, k: int) -> Iterator[str]:
        body, linkage = self.tree.bodies[k], self.linkage
        if body.base >= 0:
            for axis in (0, 1):
                stiff = float(linkage.supports.stiffness[body.node, axis])
                if np.isfinite(stiff):
                    unit = linkage.supports.axes[body.node, axis]
                    entry = 2 * body.node + axis
                    self.slides.append((self._joints, entry))
                    rest = linkage.supports.places[body.node, axis]
                    rests = np.stack([rest, rest])
                    yield self._joint("slide", f"{unit[0]} {unit[1]} 0", stiff, rests)
        self.hinge[k] = -1
        if self.tree.entries[k] >= 0:
            yield self._hinge(k)
        yield f'<site name="n{body.node}"/>'
        mass = self.linkage.node_mass
        yield inertial(0.0, mass, mass * self._size**2)

    def _link(self, k: int) -> Iterator[str]:
        body, linkage = self.tree.bodies[k], self.linkage
        for axis in (0, 1) if body.floats else ():
            self.floats.append((self._joints, k, axis))
            yield self._joint("slide", "1 0 0" if axis == 0 else "0 1 0", 0.0, self._none)
        yield self._hinge(k)
        size = float(self.tree.sizes[k])
        axial = float(linkage.axial.ravel()[body.link])
        if np.isfinite(axial):
            entry = int(linkage.strain_entries.ravel()[body.link])
            self.stretches.append((self._joints, entry, body.link))
            rest = size * linkage.strains.reshape(linkage.axial.size, -1)[body.link]
            yield self._joint("slide", "1 0 0", axial / size, np.stack([rest, 0.0 * rest]))
        mass = float(linkage.masses.ravel()[body.link])
        yield inertial(0.5 * size, mass, mass * size**2 / 12.0)
        yield f'<site name="e{k}" pos="{size} 0 0"/>'

    def _hinge(self, k: int) -> str:
        self.hinge[k] = self._joints
        return self._joint("hinge", "0 0 1", *self._parts[0].get(k, (0.0, self._none)))

    def _joint(self, kind: str, axis: str, stiffness: float, rests: Rests) -> str:
        number = self._joints
        self._joints += 1
        if stiffness:
            self.joint_springs.append(Spring(number, stiffness, *rests))
        return (
            f'<joint name="j{number}" type="{kind}" axis="{axis}" stiffness="{stiffness}" '
            f'damping="{self.damping * stiffness}"/>'
        )

    # --- elastic joints -------------------------------------------------------------------------

    def _bends(self) -> tuple[dict[int, Hinge], list[Tendon]]:
        """Elastic joints that are hinges of bodies, and those that tendons replace."""
        tree, linkage = self.tree, self.linkage
        body_of = {int(entry): k for k, entry in enumerate(tree.entries) if entry >= 0}
        hinges: dict[int, Hinge] = {}
        tendons: list[Tendon] = []
        bends = linkage.bends
        for i, j, stiff, rest in zip(
            bends.plus.tolist(), bends.minus.tolist(), bends.stiffness.tolist(), bends.rest,
            strict=True,
        ):  # fmt: skip
            turned = np.stack([rest, 0.0 * rest])
            sides = []
            for entry, sign in ((i, 1.0), (j, -1.0)):
                k = body_of.get(entry, WORLD)
                sides.append(k)
                if k == WORLD:  # held: its prescribed turn goes to the other side
                    turned -= sign * linkage.targets[entry]
                else:
                    turned[0, -1] += sign * tree.offsets[k]
            self._place(sides, stiff, turned, hinges, tendons)
        for node in range(linkage.nodes):
            stiff = float(linkage.supports.turning[node])
            k = body_of.get(int(linkage.turn_entries[node]), WORLD)
            if 0.0 < stiff < np.inf and k != WORLD:
                turns = linkage.supports.turns[[node, node]]
                self._place([k, WORLD], stiff, turns, hinges, tendons)
        return hinges, tendons

    def _place(
        self,
        sides: list[int],
        stiffness: float,
        rests: Rests,
        hinges: dict[int, Hinge],
        tendons: list[Tendon],
    ) -> None:
        first, second = sides
        bodies, above = self.tree.bodies, self.tree.above
        if first != WORLD and bodies[first].parent == second and first not in hinges:
            hinges[first] = Hinge(stiffness, rests)
        elif second != WORLD and bodies[second].parent == first and second not in hinges:
            hinges[second] = Hinge(stiffness, -rests)
        else:
            nothing = np.zeros(len(bodies))
            row = above[first] if first != WORLD else nothing
            row = row - (above[second] if second != WORLD else nothing)
            tendons.append(Tendon(row, Spring(len(tendons), stiffness, *rests)))

    def _tendons(self) -> str:
        out = []
        for row, spring in self._parts[1]:
            joints = "".join(
                f'<joint joint="j{self.hinge[k]}" coef="{row[k]}"/>'
                for k in np.flatnonzero(row).tolist()
                if self.hinge[k] >= 0
            )
            out.append(
                f'<fixed stiffness="{spring.stiffness}" springlength="0" '
                f'damping="{self.damping * spring.stiffness}">{joints}</fixed>'
            )
        return "".join(out)

    def springs(self) -> tuple[list[Spring], list[Spring]]:
        """Joints and tendons whose rest the settings change; available once the text is written."""
        return self.joint_springs, [spring for _, spring in self._parts[1]]

    def drag(self) -> Float[np.ndarray, "joints settings"]:
        """Forces on all joints for each rate of the settings: dampers are carried by supports."""
        out = np.zeros((self._joints, self.linkage.couples.shape[1]))
        for spring in self.joint_springs:
            out[spring.at] += spring.stiffness * spring.held
        for row, spring in self._parts[1]:
            for k in np.flatnonzero(row).tolist():
                if self.hinge[k] >= 0:
                    out[self.hinge[k]] += row[k] * spring.stiffness * spring.held
        return np.asarray(self.damping * out)
