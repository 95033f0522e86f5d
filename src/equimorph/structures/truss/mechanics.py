"""Mechanics of a truss in batches of lanes: energy, forces, stiffness, symmetries."""

from functools import cached_property, partial
from typing import Any, ClassVar

import numpy as np

from equimorph.arrays import Entries, Flags, Float, Int, Lanes, Parameters, Values
from equimorph.linalg.dense import multiply
from equimorph.linalg.intervals import Interval, product, square, symmetric
from equimorph.linalg.sparse import SparseLayout
from equimorph.model import Actuator, ActuatorKind, Drawing, Forces, Support
from equimorph.model.drawing import supports_of_point
from equimorph.structures.any_network import (
    AnyNetwork,
    edges_of_image,
    images,
    is_symmetry,
    parameter_exchange,
)
from equimorph.structures.collapse import COLLAPSED
from equimorph.structures.contract import Growth, Symmetry
from equimorph.structures.discrete import along_corners, linearise
from equimorph.structures.equations import Direction, Enclosed
from equimorph.structures.truss.kernels import linearise_lanes
from equimorph.structures.truss.network import Energies, TrussNetwork
from equimorph.structures.unit_system import UnitSystem

BarValues = Float[np.ndarray, "lanes bars"]

SMALLEST = 0.02
"""Least size of guesses, relative to the truss."""


class TrussMechanics(AnyNetwork):
    """Energy, forces, stiffness and drawing of a truss; `Truss` adds names and checks.

    Parameters
    ----------
    network
        Joints, bars, supports.
    energies
        Energies of the bars.
    rates
        Changes of the rest lengths by the parameters.
    pulls
        Forces on the unknowns by the parameters.
    system
        Units of all numbers.
    """

    kind: ClassVar[str] = "truss"
    upward: ClassVar[str] = "z"
    unresolved = "a bar has collapsed: bound `max_shortening`"
    constraints = 0
    network: TrussNetwork

    def __init__(
        self,
        network: TrussNetwork,
        energies: Energies,
        rates: Float[np.ndarray, "bars parameters"],
        pulls: Float[np.ndarray, "parameters unknowns"],
        system: UnitSystem,
    ) -> None:
        self.network, self.energies, self.rates, self.pulls = network, energies, rates, pulls
        self.system = system
        self.unknowns = len(network.moves)
        self.mass = np.ones(self.unknowns)

    def spans(self, z: Lanes) -> Float[np.ndarray, "lanes bars space"]:
        """Vectors from the first to the second joint of every bar."""
        return np.asarray(self.network.chords + self._differences(z))

    def rest_lengths(self, p: Parameters) -> BarValues:
        """Lengths without stress."""
        return np.asarray(self.network.lengths + multiply(p, self.rates.T))

    def lengths(self, z: Lanes, p: Parameters) -> tuple[BarValues, BarValues]:
        """Squares of the lengths, and the rest lengths."""
        return np.asarray((self.spans(z) ** 2).sum(axis=2)), self.rest_lengths(p)

    def shortenings(self, z: Lanes, p: Parameters) -> BarValues:
        """Shortenings relative to the rest lengths, 1 − l/l₀."""
        squared, rest = self.lengths(z, p)
        return np.asarray(1.0 - np.sqrt(squared) / rest)

    def moves_of(self, z: Lanes) -> Float[np.ndarray, "lanes joints space"]:
        """Moves of all joints."""
        moves = np.zeros((len(z), *self.network.held.shape))
        moves[:, ~self.network.held] = z
        return moves

    def _differences(self, u: Lanes) -> Float[np.ndarray, "lanes bars space"]:
        full = self.moves_of(u)
        return np.asarray(np.diff(full[:, self.network.ends], axis=2)[:, :, 0])

    def joint_forces(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes joints space"]:
        """Forces that the joints need for balance with the bars: loads, or those of supports."""
        spans, (squared, rest) = self.spans(z), self.lengths(z, p)
        pull = self.energies.force(squared, rest) / np.sqrt(squared)
        return self._all_joints(pull[:, :, None] * spans)

    def _all_joints(
        self, forces: Float[np.ndarray, "lanes bars space"]
    ) -> Float[np.ndarray, "lanes joints space"]:
        """Sum at the joints what bars exert on their second joint, and take from their first."""
        full = np.zeros((len(forces), *self.network.held.shape))
        for bar, (first, second) in enumerate(self.network.ends.tolist()):
            full[:, second] += forces[:, bar]
            full[:, first] -= forces[:, bar]
        return full

    @cached_property
    def _unknowns_of_bars(self) -> Int[np.ndarray, "bars both"]:
        pairs = self.network.unknowns[self.network.ends]
        return np.asarray(pairs.reshape(len(self.network.members), -1))

    @cached_property
    def layout(self) -> SparseLayout:
        """One entry for each pair of unknowns that a bar joins."""
        found = {(i, i) for i in range(self.unknowns)}
        for row in self._unknowns_of_bars.tolist():
            found |= {(i, j) for i in row for j in row if i >= j >= 0}
        rows, columns = np.array(sorted(found)).T
        return SparseLayout(rows, columns, self.unknowns)

    @cached_property
    def _slots(self) -> Int[np.ndarray, "bars both both"]:
        where = {
            pair: slot
            for slot, pair in enumerate(zip(self.layout.rows, self.layout.columns, strict=True))
        }
        pairs = self._unknowns_of_bars
        return np.array([[[where.get((i, j), -1) for j in row] for i in row] for row in pairs])

    def linearised(self, z: Lanes, p: Parameters, dp: Parameters) -> tuple[Lanes, Lanes, Entries]:
        """F, F_p·dp and the entries of F_z."""
        bars = (self._unknowns_of_bars, self._slots, self.network.chords, self.energies.stiffness)
        shared = (*bars, self.network.lengths, self.rates, self.pulls, self.energies.green)
        return linearise(linearise_lanes, shared, self.layout, (z, p, dp))

    def energy(self, z: Lanes, p: Parameters) -> Values:
        """Strain energy of the bars, less the work of the loads."""
        work = (multiply(p, self.pulls) * z).sum(axis=1)
        return np.asarray(self.energies.value(*self.lengths(z, p)).sum(axis=1) - work)

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂E/∂p: for an actuator the force that it must bear, for a load minus its travel."""
        by_rest = self.energies.by_rest(*self.lengths(z, p))
        return np.asarray(multiply(by_rest, self.rates) - multiply(z, self.pulls.T))

    def plain_energy(self) -> dict[str, Any]:
        """Chords and rest lengths of the bars, unknowns at both ends (−1: held), and the rest."""
        made = self.network
        tables = {
            "chords": made.chords, "ends": made.unknowns[made.ends], "lengths": made.lengths,
            "stiffness": self.energies.stiffness, "rates": self.rates, "pulls": self.pulls,
        }  # fmt: skip
        strain = "green" if self.energies.green else "engineering"
        numbers = {key: each.tolist() for key, each in tables.items()}
        return {"kind": "truss", "strain": strain, **numbers}

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w]: bar forces are 2 ∂W/∂g · d, with d the vector between the joints."""
        d, (g, l0) = self.spans(z), self.lengths(z, p)
        (dv, lv), (dw, lw) = ((self._differences(x), multiply(y, self.rates.T)) for x, y in (v, w))
        gv, gw = (2.0 * (d * x).sum(axis=2) for x in (dv, dw))
        gg, gl = self.energies.second(g, l0)
        ggg, ggl, gll = self.energies.third(g, l0)
        twice = ggg * gv * gw + ggl * (gv * lw + lv * gw) + gll * lv * lw
        twice = twice + 2.0 * gg * (dv * dw).sum(axis=2)
        by_v, by_w = gg * gv + gl * lv, gg * gw + gl * lw
        pulls = twice[..., None] * d + by_v[..., None] * dw + by_w[..., None] * dv
        return np.asarray(self._all_joints(2.0 * pulls)[:, ~self.network.held])

    def enclosure(self, z: Interval, p: Interval) -> Enclosed:
        """Bounds over boxes; a bar pulls by f = 2 ∂W/∂g · d, d the vector between its joints."""
        chords, unknowns = self.network.chords, self.unknowns
        changes = np.moveaxis(self._differences(np.eye(unknowns)), 0, 2)
        rows = changes.reshape(-1, unknowns)
        d = product(rows, z[..., None]).reshape(-1, *chords.shape) + chords
        rest = self.network.lengths + product(self.rates, p[..., None])[..., 0]
        slope, second, mixed = self.energies.enclosures(square(d).sum(2), rest)
        stiff = 2.0 * slope[..., None, None] * np.eye(chords.shape[1])
        stiff = stiff + 4.0 * second[..., None, None] * (d[..., None] * d[..., None, :])
        halves = product(changes.transpose(0, 2, 1), stiff)  # bars, unknowns, space
        matrix = product(rows.T, halves.transpose(0, 1, 3, 2).reshape(-1, *rows.shape))
        pulls = 2.0 * (slope[..., None] * d).reshape(-1, len(rows), 1)
        by_rest = 2.0 * (mixed[..., None] * d)[..., None] * self.rates[:, None]
        forces = product(rows.T, pulls) - product(self.pulls.T, p[..., None])
        columns = product(rows.T, by_rest.reshape(-1, len(rows), len(self.pulls)))
        return Enclosed(forces[..., 0], symmetric(matrix), columns - self.pulls.T)

    # --- states ---------------------------------------------------------------------------------

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Displacements within the size of the truss along each axis, every fourth much smaller.

        A shallow dome of 24 bars has a hundred states near where it was built, to which none of
        1000 larger guesses led; with every second one small, rows of bistable bars lose states.
        Others are places anywhere in the `region` of the joints: no displacement within its own
        size turns a bar over that is held at one end.
        """
        extent = np.ptp(self.network.places, axis=0)
        reach = np.broadcast_to(np.maximum(extent, 0.2 * extent.max()), self.network.held.shape)
        shape = (len(p), self.unknowns)
        random, free = generator.uniform(-1.0, 1.0, shape), ~self.network.held
        guesses = random * reach[free]
        middle, width = (each[free] for each in self.network.region)
        guesses[1::4] = middle - self.network.places[free] + random[1::4] * width
        guesses[3::4] *= SMALLEST ** generator.uniform(0.0, 1.0, (len(guesses[3::4]), 1))
        guesses[3:4] = 0.0  # as it was built
        return np.asarray(guesses)

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """No bar has collapsed, and all rest lengths are positive."""
        l0 = self.rest_lengths(p)
        collapsed = (self.shortenings(z, p) > COLLAPSED).any(axis=1) & (not self.energies.green)
        return np.asarray((l0 > 0.0).all(axis=1) & ~collapsed)

    def growth(self, p: Float[np.ndarray, " parameters"]) -> Growth:
        """Green strain gives a polynomial of degree four, definite if no motion is free of strain.

        Its leading form is the sum of EA |Δu|⁴/(8 l₀³) over all bars: it vanishes only where no
        bar turns or stretches.
        """
        if not self.energies.green:
            return Growth(False, "engineering strain has kinks where bars shrink to points")
        if (self.rest_lengths(p[None]) <= 0.0).any():
            return Growth(False, "a rest length is not positive")
        changes = self._differences(np.eye(self.unknowns)).reshape(self.unknowns, -1)
        if np.linalg.matrix_rank(changes) < self.unknowns:
            return Growth(False, "a part of the truss has no support")
        return Growth(True, "Green strain, supported")

    def shape(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"] | None = None
    ) -> Float[np.ndarray, "lanes points space"]:
        """Joints along a walk over all bars, some of which it passes twice.

        `s` runs from 0 to 1 along it; all bars get equal lengths.
        """
        corners = self.joint_places(z)[:, self.network.walk]
        return corners if s is None else along_corners(corners, s)

    def joint_places(self, z: Lanes) -> Float[np.ndarray, "lanes joints space"]:
        """Places of the joints."""
        return np.asarray(self.network.places + self.moves_of(z))

    def displacements(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes joints space"]:
        """Moves of the joints from where they are drawn."""
        return self.moves_of(z)

    def drawing(self, z: Lanes, p: Parameters) -> Drawing:
        """Supports of the joints, forces on them, and bars that change their length."""
        made, places = self.network, self.joint_places(z)
        supports: list[Support] = []
        axes = np.eye(made.space)
        for joint, held in enumerate(made.held):
            firm = axes[held], np.full(held.sum(), np.inf)
            inward = np.broadcast_to(axes[0], (len(z), made.space))
            supports += supports_of_point(*firm, 0.0, places[:, joint], inward)
        forces = self.moves_of(multiply(p, self.pulls))
        moved = np.flatnonzero(self.rates.any(axis=1))
        at = np.flatnonzero(self.moves_of(self.pulls).any(axis=(0, 2)))
        return Drawing(
            tuple(supports),
            (Forces(places[:, at], forces[:, at]),) if len(at) else (),
            actuators=tuple(
                Actuator(ActuatorKind.LENGTH, places[:, ends]) for ends in made.ends[moved]
            ),
        )


def symmetries(truss: TrussMechanics) -> tuple[Symmetry, ...]:
    """Mirror images that leave bars, supports, loads and actuators as they are, up to signs."""
    found = []
    for name, axes, joints in images(truss.network.places):
        places = _image_parameters(truss, axes, joints)
        if places is None:
            continue
        apply = partial(_image, truss, axes, joints, *places)
        if is_symmetry(truss, apply):
            found.append(Symmetry(name, apply, *places))
    return tuple(found)


def _image_parameters(
    truss: TrussMechanics, axes: Float[np.ndarray, " space"], joints: Int[np.ndarray, " joints"]
) -> tuple[Float[np.ndarray, " parameters"], Int[np.ndarray, " parameters"]] | None:
    """Signs and order of the parameters in the image; None if the image is another truss."""
    made = truss.network
    there = edges_of_image(made.ends, joints)
    if there is None or not np.array_equal(made.held[joints], made.held):
        return None
    heres, mapped = [], []
    for rates, forces in zip(truss.rates.T, truss.moves_of(truss.pulls), strict=True):
        image, moved = np.zeros_like(forces), np.zeros_like(rates)
        image[joints], moved[there] = axes * forces, rates
        heres.append(np.append(forces, rates))
        mapped.append(np.append(image, moved))
    return parameter_exchange(heres, mapped)


def _image(
    truss: TrussMechanics,
    axes: Float[np.ndarray, " space"],
    joints: Int[np.ndarray, " joints"],
    signs: Float[np.ndarray, " parameters"],
    order: Int[np.ndarray, " parameters"],
    z: Lanes,
    p: Parameters,
) -> tuple[Lanes, Parameters]:
    moves = truss.moves_of(z)
    image = np.zeros_like(moves)
    image[:, joints] = axes * moves
    unknown = image[:, ~truss.network.held]
    return np.ascontiguousarray(unknown), np.ascontiguousarray(signs * p[:, order])
