"""PlanarMechanics of general rods: energy, residual, derivatives and solves in batches."""

from functools import cached_property

import numpy as np

from equimorph.arrays import (
    Flags,
    Float,
    Lanes,
    Nodal,
    Parameters,
    Scalars,
    Sides,
    Values,
)
from equimorph.linalg import BorderedSolution, CondensedLayout, no_border
from equimorph.linalg.condensed import UNCOUPLED
from equimorph.linalg.lanes import over_lanes
from equimorph.structures.contract import Symmetry
from equimorph.structures.equations import (
    Advance,
    AnyBorder,
    Direction,
    Shift,
    Solver,
)
from equimorph.structures.rod.general_fields import GeneralFields
from equimorph.structures.rod.general_inertia import GeneralInertia
from equimorph.structures.rod.general_kernels import energy_lanes, linearise_lanes, second_lanes
from equimorph.structures.rod.general_step_kernels import advance_lanes
from equimorph.structures.rod.mechanics import LARGEST_TAIL
from equimorph.structures.rod.model import RodModel, pack_tables
from equimorph.structures.rod.planar_energy import PlanarEnergy
from equimorph.structures.rod.pressure import EnclosedArea, coupling
from equimorph.structures.rod.reflections import symmetries
from equimorph.structures.rod.waves import MODES, single_waves
from equimorph.structures.whole_turns import WholeTurns

Points = Float[np.ndarray, "lanes points"]

SMOOTH = 1e-6
"""Highest Legendre coefficients of θ below which nothing inside the elements can go wrong."""
LARGEST_GAP = 1e-4
"""Radians between θ as integrated and as solved for; errors of κ are about 100 times larger."""
FORCES = 8.0
"""Standard deviation of random multipliers: the compressed shapes with max |κ| near 20."""
PLACE = 2
"""Multipliers of a rod whose ends are held in place: forces along x and y."""


class GeneralMechanics(GeneralInertia):
    """A rod whose Lagrangian is a `RodModel`."""

    def __init__(self, model: RodModel) -> None:
        self.model, self.mesh = model, model.mesh
        self.constraints, self.held = model.multipliers, model.held
        self.parameters = len(model.names)
        start, stop = model.held
        ends = np.array([int(start), model.mesh.elements - int(stop)])
        pressed = model.pressure.any()
        coupled = coupling(model.mesh, model.closing) if pressed else UNCOUPLED
        self.layout = CondensedLayout(np.ascontiguousarray(model.stiffness), ends, coupled)
        self.mass = model.mesh.weights[self.unknown_nodes].copy()
        self.unknowns = len(self.mass)
        self._area = EnclosedArea.of_rod(model.mesh, model.closing) if pressed else None

    @property
    def unknown_nodes(self) -> slice:
        """Nodes whose angles are unknown."""
        return self.layout.unknown

    @cached_property
    def _step_data(self) -> tuple[object, ...]:
        model, parts = self.model, pack_tables(self.model)
        squared, turned = (np.ascontiguousarray(a) for a in (model.quadratic, model.turned))
        tables = parts.points, model.softness, parts.slope, parts.picks, parts.splits
        first = np.int64(self.unknown_nodes.start)
        pressure = np.ascontiguousarray(model.pressure)
        pressed = self.layout.coupling.tables, pressure
        return self.layout.stiffness, *tables, squared, turned, first, *pressed

    def scalars(self, z: Lanes, p: Parameters) -> Scalars:
        """Multipliers, parameters and 1."""
        return np.concatenate([z[:, self.unknowns :], p, np.ones((len(z), 1))], axis=1)

    # --- fields -----------------------------------------------------------------------------

    def nodal_angles(self, z: Lanes, p: Parameters) -> Nodal:
        """Angles θ at all nodes, the prescribed ends included."""
        z, p = self.check_widths((z, p))
        return self._angles(z, self.scalars(z, p))

    def _angles(self, z: Lanes, y: Scalars) -> Nodal:
        theta = np.einsum("kj,lj->lk", self.model.turned, y)
        out = np.empty((len(z), len(self.mesh.nodes)))
        out[:, 0], out[:, -1] = theta[:, 0], theta[:, 1]
        out[:, self.unknown_nodes] = z[:, : self.unknowns]
        return out

    @cached_property
    def _fields(self) -> GeneralFields:
        return GeneralFields(self.model)

    def fields(
        self, z: Lanes, p: Parameters, s: Float[np.ndarray, " points"]
    ) -> Float[np.ndarray, "lanes points 4"]:
        """(θ, κ, x, y) at arclengths."""
        return self._fields.at(self.nodal_angles(z, p), self.scalars(z, p), s)

    def largest_curvature(self, z: Lanes, p: Parameters) -> tuple[Values, Values]:
        """max_s |κ(s)| and where it occurs."""
        return self._fields.largest_curvature(self.nodal_angles(z, p), self.scalars(z, p))

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether θ is smooth in every element, and the rod's equations integrated there meet it.

        Forces much above the buckling load of an element, like high pressure, amplify the error of
        its ends inside it, before the coefficients of θ show anything.
        """
        tail = self.tail(z, p)
        good = tail < LARGEST_TAIL
        doubtful = np.flatnonzero(good & (tail > SMOOTH))
        if len(doubtful):
            some, at = z[doubtful], p[doubtful]
            gap = self._fields.gap(self.nodal_angles(some, at), self.scalars(some, at))
            good[doubtful] = gap < LARGEST_GAP
        return np.asarray(good)

    @cached_property
    def whole_turns(self) -> WholeTurns:
        """A turn by 2π if the angles of both ends are free, or held by springs."""
        whole = np.ones((int(not any(self.model.held)), self.unknowns), bool)
        return WholeTurns.of_parts(whole, self.model.springs.any() & whole[:, 0], self.size)

    @property
    def is_extensible(self) -> bool:
        """Whether the axis stretches."""
        return bool(self.model.softness.any())

    def shortenings(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes points"]:
        """Elastic shortenings of the axis at the nodes of every element."""
        turned = self._turned(self.nodal_angles(z, p))
        normal, pull = self._normal(turned, self.scalars(z, p))
        return np.asarray(self.model.softness * (normal + pull))

    # --- contract ---------------------------------------------------------------------------

    def energy(self, z: Lanes, p: Parameters) -> Values:
        """L without the multipliers' part."""
        z, p = self.check_widths((z, p))
        out = np.empty(len(z))
        over_lanes(energy_lanes, self._step_data, [z, p], [out])
        return out

    def _turned(self, theta: Nodal) -> tuple[Points, Points]:
        """Return sin θ and cos θ at the nodes of every element."""
        places = self.mesh.element_nodes.ravel()
        return np.sin(theta)[:, places], np.cos(theta)[:, places]

    def _normal(self, turned: tuple[Points, Points], y: Scalars) -> tuple[Points, Points]:
        """N and T at the nodes of every element."""
        a, b, pull = (y @ each for each in (self.model.sine, self.model.cosine, self.model.tension))
        return a * turned[0] + b * turned[1], pull

    def _pressure(self, y: Scalars) -> Values:
        return np.asarray(np.einsum("j,lj->l", self.model.pressure, y))

    def _gradient(self, theta: Nodal, y: Scalars) -> Scalars:
        """∂L/∂y at fixed θ."""
        sine, cosine = turned = self._turned(theta)
        normal, pull = self._normal(turned, y)
        stretch, model = 1.0 - self.model.softness * (normal + pull), self.model
        out = (stretch * sine) @ model.sine.T + (stretch * cosine) @ model.cosine.T
        out += (stretch - 1.0) @ model.tension.T - theta @ model.slope.T
        if self._area is not None:
            out -= self._area.value(theta)[:, None] * model.pressure
        return np.asarray(out + y @ model.quadratic)

    def _end_moments(self, theta: Nodal, y: Scalars) -> Float[np.ndarray, "lanes 2"]:
        """∂L/∂θ at both ends of the rod."""
        d, model, ends = self.mesh.degree, self.model, [0, -1]
        tables = (model.sine, model.cosine, model.tension)
        a, b, pull = (y @ each[:, ends] for each in tables)
        sine, cosine = np.sin(theta[:, ends]), np.cos(theta[:, ends])
        stretch = 1.0 - model.softness[ends] * (a * sine + b * cosine + pull)
        out = stretch * (a * cosine - b * sine)
        out -= y @ model.slope[:, ends]
        out[:, 0] += theta[:, : d + 1] @ model.stiffness[0, 0]
        out[:, 1] += theta[:, -d - 1 :] @ model.stiffness[-1, -1]
        if self._area is not None:
            out -= self._pressure(y)[:, None] * self._area.gradient(theta)[:, ends]
        return np.asarray(out)

    def support_forces(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes 2"]:
        """Force of the support at A: multipliers, or what balances the loads."""
        y = self.scalars(z, p)
        force = np.einsum("kj,lj->lk", self.model.reaction, y)
        if self._area is not None:  # pressure on the chord up to its pole is taken up at A
            chord = self._area.chord(self.nodal_angles(z, p))
            x, y_pole = (chord @ self._area.pole.T).T
            force += self._pressure(y)[:, None] * np.stack([y_pole, -x], axis=1)
        return np.asarray(force)

    def end_moments(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes 2"]:
        """Couples that hold the angles, of springs too; 0 at free angles."""
        theta, y, model = self.nodal_angles(z, p), self.scalars(z, p), self.model
        rest = np.einsum("kj,lj->lk", model.rest, y)
        held = self._end_moments(theta, y)
        sprung = model.springs * (rest - theta[:, [0, -1]])
        return np.asarray(np.where(model.held, held, sprung))

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂p."""
        theta, y = self.nodal_angles(z, p), self.scalars(z, p)
        out = self._gradient(theta, y) + self._end_moments(theta, y) @ self.model.turned
        return np.ascontiguousarray(out[:, self.constraints : -1])

    def linearised(self, z: Lanes, p: Parameters, dp: Parameters) -> tuple[np.ndarray, ...]:
        """F, F_p·dp, and the parts of F_z: diagonal, border, trailing block."""
        z, p, _, dp = self.check_widths((z, p), (z, dp))
        lanes, nodes, m = len(z), self.layout.nodes, self.constraints
        out = (
            np.empty_like(z),
            np.empty_like(z),
            np.empty((lanes, nodes)),
            np.empty((lanes, m, nodes)),
            np.empty((lanes, m, m)),
        )
        over_lanes(linearise_lanes, self._step_data, [z, p, dp], out)
        return out

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w]."""
        arrays = self.check_widths((z, p), v, w)
        out = np.empty_like(arrays[0])
        _, points, softness, _, picks, splits, _, turned, first, *pressed = self._step_data
        sizes = np.int64(self.mesh.elements), np.int64(self.constraints), first
        shared = (points, softness, picks, splits, turned, *sizes, *pressed)
        over_lanes(second_lanes, shared, arrays, [out])
        return out

    @cached_property
    def planar_energy(self) -> PlanarEnergy:
        """Tables of the model."""
        model, nodes = self.model, len(self.mesh.nodes)
        areas = () if self._area is None else (self._area,)
        place, turned = np.full(nodes, -1), np.zeros((nodes, model.scalars))
        place[self.unknown_nodes] = range(self.unknowns)
        turned[[0, -1]] = model.turned
        return PlanarEnergy(
            place=place, turned=turned, elements=self.mesh.element_nodes,
            stiffness=self.layout.stiffness, springs=np.zeros(nodes), slope=model.slope,
            points=self.mesh.element_nodes.ravel(), sine=model.sine, cosine=model.cosine,
            stretch=np.zeros_like(model.sine), tension=model.tension, softness=model.softness,
            quadratic=model.quadratic, pressure=model.pressure[None][: len(areas)], areas=areas,
        )  # fmt: skip

    def solver(
        self, parts: tuple[np.ndarray, ...], z: Lanes, p: Parameters, shift: Shift = None
    ) -> Solver:
        """Solves with F_z − shift·mass."""
        diagonal, gradients, trailing = parts
        if shift is not None:
            diagonal = diagonal - shift[:, None] * self.mesh.weights
        bent = None
        if self._area is not None:
            bent = self.nodal_angles(z, p), self._pressure(self.scalars(z, p))

        def solve(rhs: Sides, border: AnyBorder) -> BorderedSolution:
            around = no_border(len(z), self.size) if border is None else border
            sides = diagonal, gradients, *around, rhs
            return self.layout.solve(*sides, trailing=trailing, bent=bent)

        return solve

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One fused kernel."""
        shared = (self.layout.ends, *self._step_data)
        return self.fused_advance(advance_lanes, shared, z, p, dp, row, corner, defect)

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Random curvatures between the angles of ends, or of their springs at rest; forces.

        Where both places of the ends are held, some are `single_waves`.
        """
        lanes, s, base = len(p), self.mesh.nodes, self.straight_angles(p)
        amplitude = generator.normal(size=(lanes, len(MODES))) * (3.0 / MODES)
        amplitude *= generator.uniform(size=(lanes, 1))
        turn: Nodal = np.zeros((lanes, 1))
        start, stop = held = self.model.held
        if start == stop:
            waves = np.sin(np.pi * np.outer(MODES, s))
            turn = turn if start else generator.normal(size=(lanes, 1))
        else:
            waves = np.sin(np.pi * np.outer(MODES - 0.5, s if start else 1 - s))
        theta = base + turn + amplitude @ waves
        forces = generator.normal(size=(lanes, self.constraints)) * FORCES
        if self.constraints == PLACE:
            some, wave, forces[some, 0] = single_waves(self.mesh, held, lanes, generator)
            theta[some], forces[some, 1] = base[some] + wave, 0.0
        return np.concatenate([theta[:, self.unknown_nodes], forces], axis=1)

    def straight_angles(self, p: Parameters) -> Nodal:
        """Angles linear in s between those of ends, or of their springs at rest."""
        lanes, s = len(p), self.mesh.nodes
        y = np.concatenate([np.zeros((lanes, self.constraints)), p, np.ones((lanes, 1))], axis=1)
        ends = np.einsum("kj,lj->lk", self.model.turned + self.model.rest, y)
        known = np.array(self.model.held) | (self.model.springs > 0.0)
        share = s if known.all() else np.full_like(s, float(known[1]))
        return np.asarray(ends[:, :1] * (1 - share) + ends[:, 1:] * share)

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Mirror images and half turns that leave the Lagrangian as it is."""
        return symmetries(self.model, self.unknowns)
