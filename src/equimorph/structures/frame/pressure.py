"""Pressure on a chain of members of a frame: the area between the chain and its chord.

See docs/decisions.md, "Pressure on rods and frames is an enclosed area".
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from equimorph.arrays import Complex, Entries, Float, Int, Nodal, Scalars, Values
from equimorph.linalg.dense import multiply
from equimorph.linalg.sparse import SparseLayout
from equimorph.structures.rod.pressure import (
    EnclosedArea,
    closing,
    double_quadrature,
    pressed_rows,
    row_ends,
    unit_tangents,
)

Points = Float[np.ndarray, "lanes points"]
Along = Float[np.ndarray, "lanes along"]
"""A field at the nodes of one chain."""
Fields = Complex[np.ndarray, "lanes points"]
ROUND_OFF = 1e-15
"""Share of the largest entry of W below which one of E is none."""
BLOCK = 128
"""Matrices that are assembled together: the cost of a call is small against theirs."""


@dataclass(frozen=True, eq=False)
class PressedChain:
    """Members one after the other that are under one pressure.

    scalar, size: the pressure p is `size` times this scalar; pieces, signs: members in the order of
    the chain, −1 where it runs from the end of one to its start. The pressure acts to the left of
    the chain. V is the area that the chain encloses with its chord; a chain that closes has no
    first joint, so that V is the mean of those that begin at each of its joints.
    """

    model: Any
    scalar: int
    size: float
    pieces: Int[np.ndarray, " chain"]
    signs: Float[np.ndarray, " chain"]

    @cached_property
    def ends(self) -> tuple[int, int]:
        """First and last joint; the same where the chain closes."""
        pairs = self.model.network.ends
        (first, last), back = self.pieces[[0, -1]], self.signs[[0, -1]] < 0.0
        return int(pairs[first, int(back[0])]), int(pairs[last, 1 - int(back[1])])

    @classmethod
    def of(cls, model: Any, k: int, given: Float[np.ndarray, " pieces"]) -> "PressedChain":
        """Chain of the members on which parameter k is a pressure, with signs."""
        pairs, at = model.network.ends, np.flatnonzero(given)
        ways = [(int(piece), *pairs[piece][:: int(np.sign(given[piece]))].tolist()) for piece in at]
        leaving = {start: (piece, stop) for piece, start, stop in ways}
        starts = sorted(set(leaving) - {stop for *_, stop in ways}) or sorted(leaving)
        order: list[int] = []
        here = starts[0]
        while len(order) < len(at):
            piece, here = leaving[here]
            order.append(piece)
        pieces = np.array(order)
        size = float(np.abs(given[pieces[0]]))
        return cls(model, model.multipliers + k, size, pieces, np.sign(given[pieces]))

    @property
    def is_closed(self) -> bool:
        """Whether it ends where it begins."""
        return self.ends[0] == self.ends[1]

    # --- points, in the order of the chain ------------------------------------------------------

    @cached_property
    def points(self) -> Int[np.ndarray, "elements order"]:
        """Points of the frame."""
        count = self.model.mesh.element_nodes.size
        rows = self.pieces[:, None] * count + np.arange(count)
        rows[self.signs < 0.0] = rows[self.signs < 0.0, ::-1]
        return np.asarray(rows.reshape(-1, self.model.mesh.degree + 1))

    @cached_property
    def along(self) -> Float[np.ndarray, " points"]:
        """1 at points of members that run along the chain, −1 at others."""
        return np.repeat(self.signs, self.model.mesh.element_nodes.size)

    @cached_property
    def drawn(self) -> Complex[np.ndarray, " points"]:
        """Tangents along the chain as drawn, as complex numbers."""
        return np.asarray(self.along * np.exp(1j * self.model.directions[self.points.ravel()]))

    @cached_property
    def weights(self) -> Float[np.ndarray, "elements order"]:
        """Quadrature weights."""
        return np.asarray(self.model.weights[self.points])

    @cached_property
    def lengths(self) -> Float[np.ndarray, " elements"]:
        """Lengths of the elements."""
        return np.asarray(self.weights.sum(axis=1))

    @cached_property
    def quadrature(self) -> Float[np.ndarray, "points points"]:
        """W at the points."""
        own = np.arange(len(self.points))
        member = own // self.model.mesh.elements
        sides = np.sign(own[:, None] - own).astype(float)
        if self.is_closed:
            sides -= 2.0 * (member[:, None] - member) / len(self.pieces)
        integral = self.model.mesh.reference.integral
        whole = double_quadrature(self.weights, self.lengths, integral, sides)
        return np.asarray(whole.reshape(self.drawn.size, -1))

    # --- nodes ----------------------------------------------------------------------------------

    @cached_property
    def _numbered(self) -> tuple[Int[np.ndarray, " nodes"], Int[np.ndarray, " points"]]:
        nodes, at = np.unique(self.model.nodes.ravel()[self.points.ravel()], return_inverse=True)
        return nodes, at.ravel()

    @property
    def nodes(self) -> Int[np.ndarray, " nodes"]:
        """Nodes of the frame along the chain."""
        return self._numbered[0]

    @cached_property
    def area(self) -> EnclosedArea:
        """V by the turns ψ of these nodes."""
        nodes, at = self._numbered
        count, phases = len(nodes), self.drawn
        coupled = -1j * self.quadrature * np.outer(phases.conj(), phases)
        total, chord = np.zeros((count, count), complex), np.zeros(count, complex)
        np.add.at(total, (at[:, None], at), coupled)
        np.add.at(chord, at, phases * self.weights.ravel())
        odd, even = -0.5 * (total.imag - total.imag.T), 0.5 * (total.real + total.real.T)
        even[np.abs(even) <= ROUND_OFF * np.abs(self.quadrature).max()] = 0.0
        return EnclosedArea(odd, even, chord, self._closing)

    @cached_property
    def _closing(self) -> Float[np.ndarray, "2 2"]:
        if self.is_closed:
            return np.zeros((2, 2))
        first, last = (
            np.flatnonzero(np.isfinite(self.model.network.supports[at, :2])).tolist()
            for at in self.ends
        )
        return closing((first, last), 0.0)

    # --- what it adds to the Lagrangian ---------------------------------------------------------

    def pull(self, y: Scalars) -> Float[np.ndarray, "lanes 1"]:
        """p, or its change where y is that of the scalars."""
        return np.asarray(self.size * y[:, self.scalar : self.scalar + 1])

    @property
    def row(self) -> Float[np.ndarray, " scalars"]:
        """p by scalar."""
        return np.asarray(self.size * np.eye(self.model.scalars)[self.scalar])

    def at(self, values: Nodal) -> Along:
        """Values at the nodes of the chain, lane by lane in memory: sums keep their order."""
        return np.take(values, self.nodes, axis=1)

    def spread(self, values: Along) -> Nodal:
        """Values at the nodes of the chain, and 0 at the frame's other nodes."""
        out = np.zeros((len(values), len(self.model.place)))
        out[:, self.nodes] = values
        return out

    @cached_property
    def whole_area(self) -> EnclosedArea:
        """V by the turns of all nodes of the frame."""
        count, nodes, area = len(self.model.place), self.nodes, self.area
        matrix, even = np.zeros((2, count, count))
        weights = np.zeros(count, complex)
        for wide, own in ((matrix, area.matrix), (even, area.even)):
            wide[np.ix_(nodes, nodes)] = own
        weights[nodes] = area.weights
        return EnclosedArea(matrix, even, weights, area.closing)

    # --- forces ---------------------------------------------------------------------------------

    def tangents(self, turns: Nodal) -> Fields:
        """Tangents along the chain at its points, as complex numbers."""
        return np.asarray(
            self.drawn * np.take(unit_tangents(self.at(turns)), self._numbered[1], axis=1)
        )

    def forces(self, y: Scalars, turns: Nodal) -> Fields:
        """What p adds at the points to the force in the chain, of what lies beyond on the rest.

        It is −p (r − pole) turned by a quarter; the pole is the mean of the joints of a chain that
        closes, else see `EnclosedArea.pole`.
        """
        places, end = self.places(self.tangents(turns))
        if self.is_closed:
            pole = places[:, :: self.model.mesh.element_nodes.size].mean(axis=1)
        else:
            (xx, xy), (yx, yy) = self.area.pole
            pole = (xx + 1j * yx) * end.real + (xy + 1j * yy) * end.imag
        return np.asarray(-1j * self.pull(y) * (places - pole[:, None]))

    def places(self, tangents: Fields) -> tuple[Fields, Complex[np.ndarray, " lanes"]]:
        """Places of the points from the first joint, and of the last joint."""
        field = tangents.reshape(len(tangents), *self.points.shape)
        inside = np.einsum("ij,lej->lei", self.model.mesh.reference.integral, field)
        inside = inside * self.lengths[:, None]
        stops = np.cumsum(inside[:, :, -1], axis=1)
        starts = stops - inside[:, :, -1]
        return (starts[:, :, None] + inside).reshape(tangents.shape), stops[:, -1]

    def reactions(self, y: Scalars, turns: Nodal) -> tuple[Fields, Fields]:
        """What p adds to the forces of the supports on the first and on the last joint."""
        force = self.forces(y, turns)
        return -force[:, :1], force[:, -1:]

    def moments(self, y: Scalars, turns: Nodal) -> Points:
        """−p ∂V/∂θ at every point by itself."""
        tangents = self.tangents(turns)
        arms = self.weights.ravel() * tangents
        ends = self.area.closed * arms.sum(axis=1)[:, None] * arms
        x, across = (multiply(part, self.quadrature.T) for part in (tangents.real, tangents.imag))
        return np.asarray(self.pull(y) * (tangents.real * x + tangents.imag * across + ends.imag))


@dataclass(frozen=True, eq=False)
class FramePressure:
    """What pressures add to the Lagrangian of a frame and to its forces: −Σ p V."""

    model: Any
    layout: SparseLayout
    chains: tuple[PressedChain, ...]

    def energy(self, y: Scalars, turns: Nodal) -> Values:
        """−Σ p V."""
        parts = [each.pull(y)[:, 0] * each.area.value(each.at(turns)) for each in self.chains]
        return np.asarray(-np.sum(parts, axis=0))

    def moments(self, y: Scalars, turns: Nodal) -> Nodal:
        """Derivatives by the turns of all nodes."""
        parts = [
            each.spread(each.pull(y) * each.area.gradient(each.at(turns))) for each in self.chains
        ]
        return np.asarray(-np.sum(parts, axis=0))

    def change(self, y: Scalars, turns: Nodal, dy: Scalars, dturns: Nodal) -> Nodal:
        """Change of these along a direction."""
        parts = []
        for each in self.chains:
            psi, moved = each.at(turns), each.at(dturns)
            part = each.pull(y) * each.area.gradient_derivative(psi, moved)
            parts.append(each.spread(part + each.pull(dy) * each.area.gradient(psi)))
        return np.asarray(-np.sum(parts, axis=0))

    def second(
        self, y: Scalars, turns: Nodal, yv: Scalars, tv: Nodal, yw: Scalars, tw: Nodal
    ) -> Nodal:
        """Second change of these along two directions v and w, of scalars and of turns."""
        parts = []
        for each in self.chains:
            psi, by_v, by_w = (each.at(part) for part in (turns, tv, tw))
            part = each.pull(y) * each.area.second(psi, by_v, by_w)
            part = part + each.pull(yv) * each.area.gradient_derivative(psi, by_w)
            part = part + each.pull(yw) * each.area.gradient_derivative(psi, by_v)
            parts.append(each.spread(part))
        return np.asarray(-np.sum(parts, axis=0))

    def effort(self, turns: Nodal) -> Scalars:
        """Derivatives by the scalars."""
        parts = [each.area.value(each.at(turns))[:, None] * each.row for each in self.chains]
        return np.asarray(-np.sum(parts, axis=0))

    @cached_property
    def _couplings(self) -> list[tuple[PressedChain, Int[np.ndarray, " free"], np.ndarray]]:
        """Chains, those of their nodes that are unknowns, and entries of F_z of pairs of these."""
        numbers, found = np.full((self.layout.size, self.layout.size), -1), []
        numbers[self.layout.rows, self.layout.columns] = range(len(self.layout.rows))
        for each in self.chains:
            place = self.model.place[each.nodes]
            free = np.argsort(place)[np.count_nonzero(place < 0) :]
            rows, columns = np.tril_indices(len(free))
            found.append((each, free, numbers[place[free][rows], place[free][columns]]))
        return found

    def add_entries(self, entries: Entries, y: Scalars, turns: Nodal) -> None:
        """Add the second derivatives by the unknown turns to the entries of F_z."""
        for each, free, slots in self._couplings:
            part, none = each.area.part(free), np.zeros((len(free), len(free)))
            for start in range(0, len(entries), BLOCK):
                some = slice(start, start + BLOCK)
                psi, pull = each.at(turns[some]), each.pull(y[some])
                rows = pressed_rows(psi[:, free], pull, none, part)
                rows[row_ends(0, len(free))] = (-pull * each.area.curvature(psi))[:, free].T
                entries[some, slots] += rows.T

    def point_moments(self, y: Scalars, turns: Nodal) -> Points:
        """Derivatives by the turn of every point of the frame by itself."""
        out = np.zeros((len(turns), len(self.model.owner)))
        for each in self.chains:
            out[:, each.points.ravel()] += each.moments(y, turns)
        return out

    def forces(self, y: Scalars, turns: Nodal) -> Float[np.ndarray, "lanes points 2"]:
        """What they add to the force at every point of the frame."""
        out = np.zeros((len(turns), len(self.model.owner)), complex)
        for each in self.chains:
            out[:, each.points.ravel()] += each.along * each.forces(y, turns)
        return np.stack([out.real, out.imag], axis=2)

    def reactions(self, y: Scalars, turns: Nodal) -> Float[np.ndarray, "lanes joints 2"]:
        """What they add to the forces of the supports at the ends of chains."""
        out = np.zeros((len(turns), len(self.model.network.joints)), complex)
        for each in self.chains:
            if not each.is_closed:
                out[:, each.ends] += np.concatenate(each.reactions(y, turns), axis=1)
        return np.stack([out.real, out.imag], axis=2)
