"""Mechanics of a rod in space: energy, residual, derivatives and solves in batches.

z = (q₁, q₂, …; λ): four entries a node whose rotation is unknown, then the multipliers. The
rotation of a node is q/|q|, so that z + dz is a state for every dz; the energy ½ k m (|q|² − 1)²
keeps lengths at 1, and is zero at equilibria. See docs/decisions.md, "Rotations in space".
"""

from functools import cached_property

import numpy as np
from jaxtyping import Float, Int

from equimorph.arrays import Entries, Flags, Lanes, Parameters, Scalars, Values
from equimorph.errors import InputError
from equimorph.linalg import Border, BorderedSolution
from equimorph.linalg.sparse import SparseLayout
from equimorph.structures.contract import (
    Advance,
    Direction,
    LinearSystem,
    advance_by,
    joint_system,
)
from equimorph.structures.spatial.model import SpatialModel
from equimorph.structures.spatial.quaternions import (
    FRAME,
    RIGHT,
    Jet,
    bilinear,
    clamp_rotation,
    exponential,
    normalised,
    product,
)

LENGTH_STIFFNESS = 100.0
"""k: lengths of quaternions are the stiffer in the metric, the nearer Newton's steps are to those
on the rotations; margins of states are known below it."""
LARGEST_TAIL = 5e-4
"""Highest Legendre coefficients of q, half of radians, of an element that represents its part."""
FORCES = 8.0
"""Spread of the support forces of random guesses."""

Nodes = Float[np.ndarray, "lanes nodes 4"]
Frames = Float[np.ndarray, "lanes elements order 3 3"]


class SpatialMechanics:
    """Mechanics of the Lagrangian of a `SpatialModel`; methods as in `structures.contract`."""

    def __init__(self, model: SpatialModel) -> None:
        self.model, self.mesh = model, model.mesh
        self.parameters, self.constraints = len(model.names), model.multipliers
        inner = model.unknown_nodes
        self.slopes = self.mesh.reference.derivative / self.mesh.lengths[:, None, None]
        self._weights = self.mesh.element_weights
        self._length = LENGTH_STIFFNESS * 4.0 * self.mesh.weights[inner]
        self.mass = np.repeat(4.0 * self.mesh.weights[inner], 4)
        self.unknowns = len(self.mass)

    @property
    def size(self) -> int:
        """Length of z."""
        return self.unknowns + self.constraints

    def _check(self, *pairs: Direction) -> None:
        """Refuse states and directions of other widths."""
        for pair in pairs:
            for name, given, width in zip("zp", pair, (self.size, self.parameters), strict=True):
                if given.shape[1] != width:
                    raise InputError(
                        f"`{name}` must have {width} columns; got shape {given.shape}. States "
                        "belong to the rod, and the resolution, that made them."
                    )

    # --- scalars and rotations ------------------------------------------------------------------

    def scalars(self, z: Lanes, p: Parameters) -> Scalars:
        """Multipliers, parameters and 1."""
        self._check((z, p))
        return np.concatenate([z[:, self.unknowns :], p, np.ones((len(z), 1))], axis=1)

    def _jets(
        self, z: Lanes, p: Parameters, *directions: Direction
    ) -> tuple[Float[np.ndarray, "parts lanes nodes 4"], Float[np.ndarray, "parts lanes scalars"]]:
        """Quaternions at all nodes and scalars, with their derivatives along directions."""
        parts = 2 ** len(directions)
        y = np.zeros((parts, *self.scalars(z, p).shape), np.result_type(z, p))
        y[0] = self.scalars(z, p)
        q = np.zeros((parts, len(z), len(self.mesh.nodes), 4), y.dtype)
        inner = self.model.unknown_nodes
        q[0][:, inner] = z[:, : self.unknowns].reshape(len(z), self.unknowns // 4, 4)
        for k, (dz, dp) in enumerate(directions):
            y[1 + k, :, :-1] = np.concatenate([dz[:, self.unknowns :], dp], axis=1)
            q[1 + k][:, inner] = dz[:, : self.unknowns].reshape(len(z), self.unknowns // 4, 4)
        for side, node in enumerate((0, -1)):
            if self.model.held[side]:
                angles = np.einsum("ks,...ls->...lk", self.model.turned[side], y)
                q[:, :, node] = clamp_rotation(angles)
        return q, y

    def rotations(self, z: Lanes, p: Parameters) -> Nodes:
        """Unit quaternions at all nodes, those of the ends included."""
        q = self._jets(z, p)[0][0]
        return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))

    # --- the Lagrangian in unit quaternions -----------------------------------------------------

    def element_strains(self, q: Jet) -> tuple[Jet, Jet, Jet]:
        """q e_k and q' at the nodes of every element, and u."""
        local = q[:, :, self.mesh.element_nodes]
        turned = np.einsum("kab,...b->...ka", RIGHT, local)
        moved = np.einsum("eij,pleja->pleia", self.slopes, local)
        strain = 2.0 * bilinear(lambda a, b: np.einsum("...ka,...a->...k", a, b), turned, moved)
        return turned, moved, strain

    def section_forces(self, q: Jet, y: Jet) -> tuple[Jet, Jet]:
        """∂a_k/∂q and a_k: of the force on the cross-section, on its axes."""
        local = q[:, :, self.mesh.element_nodes]
        force = np.einsum("pls,seic->pleic", y, self.model.force)

        def pull(f: np.ndarray, at: np.ndarray) -> np.ndarray:
            return np.asarray(np.einsum("...c,kcab,...b->...ka", f, FRAME, at, optimize=True))

        slope = 2.0 * bilinear(pull, force, local)
        axial = 0.5 * bilinear(lambda a, b: np.einsum("...ka,...a->...k", a, b), slope, local)
        return slope, axial

    def stretches(self, axial: Jet, y: Jet) -> Jet:
        """∂L/∂a_k over the weights: 1 + extension, and shears."""
        pull = np.zeros_like(axial)
        pull[..., 0] = np.einsum("pls,sei->plei", y, self.model.tension)
        out = -self.model.softness * (axial + pull)
        out[0, ..., 0] += 1.0
        return np.asarray(out)

    def section_moments(self, strain: Jet, y: Jet) -> Jet:
        """Moments on the axes of the cross-section."""
        out = self.model.stiffness * strain
        out = out - np.einsum("pls,seik->pleik", y, self.model.moment)
        torsion = np.einsum("pls,sei->plei", y, self.model.torsion)
        out[..., 0] += bilinear(np.multiply, torsion, strain[..., 0])
        return np.asarray(out)

    def _slope(self, q: Jet, y: Jet) -> Jet:
        """Gradient of L by unit quaternions at all nodes."""
        turned, moved, strain = self.element_strains(q)
        weights = self._weights[..., None]
        moment = 2.0 * weights * self.section_moments(strain, y)
        pull, axial = self.section_forces(q, y)
        stretch = weights * self.stretches(axial, y)

        def combine(a: np.ndarray, b: np.ndarray) -> np.ndarray:
            return np.asarray(np.einsum("...k,...ka->...a", a, b))

        own = -np.einsum("kab,...b->...ka", RIGHT, moved)
        local = bilinear(combine, moment, own) + bilinear(combine, stretch, pull)
        spread = bilinear(combine, moment, turned)
        local = local + np.einsum("eij,pleia->pleja", self.slopes, spread)
        return self._assemble(local)

    def _assemble(self, local: Float[np.ndarray, "... elements order 4"]) -> np.ndarray:
        """Sum what belongs to the same node."""
        out = np.zeros((*local.shape[:-3], len(self.mesh.nodes), 4), local.dtype)
        for e, nodes in enumerate(self.mesh.element_nodes):
            out[..., nodes, :] += local[..., e, :, :]
        return out

    def _by_scalars(self, q: Jet, y: Jet) -> Jet:
        """∂L/∂y at fixed rotations."""
        _, _, strain = self.element_strains(q)
        _, axial = self.section_forces(q, y)
        weights = self._weights[..., None]
        stretch = weights * self.stretches(axial, y)
        local, model = q[:, :, self.mesh.element_nodes], self.model

        def turn(a: np.ndarray, b: np.ndarray) -> np.ndarray:
            return np.asarray(np.einsum("...a,kcab,...b->...kc", a, FRAME, b, optimize=True))

        frames = bilinear(turn, local, local)
        pointing = bilinear(lambda a, b: np.einsum("...k,...kc->...c", a, b), stretch, frames)
        out = np.einsum("pleic,seic->pls", pointing, model.force)
        out = out - np.einsum("pleik,seik->pls", weights * strain, model.moment)
        twisting = 0.5 * self._weights * bilinear(np.multiply, strain[..., 0], strain[..., 0])
        out = out + np.einsum("plei,sei->pls", twisting, model.torsion)
        shortening = stretch[..., 0].copy()
        shortening[0] -= self._weights
        out = out + np.einsum("plei,sei->pls", shortening, model.tension)
        return np.asarray(out + np.einsum("pls,st->plt", y, model.quadratic))

    # --- contract -------------------------------------------------------------------------------

    def energy(self, z: Lanes, p: Parameters) -> Values:
        """L without the multipliers' part."""
        given, y = self._jets(z, p)
        m = self.constraints
        q, _, square = normalised(given)
        _, _, strain = self.element_strains(q)
        _, axial = self.section_forces(q, y)
        bending = np.einsum("pls,seik->pleik", y, self.model.moment)
        moment = self.section_moments(strain, y)
        density = 0.5 * ((moment - bending) * strain).sum(axis=-1)
        density = density + axial[..., 0]
        pull = axial.copy()
        pull[..., 0] += np.einsum("pls,sei->plei", y, self.model.tension)
        density = density - 0.5 * (self.model.softness * pull**2).sum(axis=-1)
        total = np.einsum("ei,lei->l", self._weights, density[0])
        total = total + 0.5 * np.einsum("ls,st,lt->l", y[0], self.model.quadratic, y[0])
        total = total - (y[0][:, :m] * self._by_scalars(q, y)[0][:, :m]).sum(axis=1)
        excess = square[0][:, self.model.unknown_nodes] - 1.0
        return np.asarray(total + 0.125 * (excess**2 @ self._length))

    def _equations(self, z: Lanes, p: Parameters, *directions: Direction) -> Jet:
        """F with its derivatives along directions."""
        given, y = self._jets(z, p, *directions)
        unit, inverse, square = normalised(given)
        slope = self._slope(unit, y)
        along = bilinear(lambda a, b: (a * b).sum(axis=-1), unit, slope)
        across = slope - bilinear(lambda a, b: a[..., None] * b, along, unit)
        out = bilinear(lambda a, b: a[..., None] * b, inverse, across)
        excess = square.copy()
        excess[0] -= 1.0
        inner = self.model.unknown_nodes
        length = bilinear(lambda a, b: a[..., None] * b, excess, given)[:, :, inner]
        out = out[:, :, inner] + 0.5 * self._length[:, None] * length
        closing = self._by_scalars(unit, y)[..., : self.constraints]
        return np.concatenate([out.reshape(*out.shape[:2], self.unknowns), closing], axis=-1)

    def residual(self, z: Lanes, p: Parameters) -> Lanes:
        """F(z; p)."""
        return np.asarray(self._equations(z, p)[0])

    def parameter_derivative(self, z: Lanes, p: Parameters, dp: Parameters) -> Lanes:
        """F_p·dp."""
        return np.asarray(self._equations(z, p, (np.zeros_like(z), dp))[1])

    def second_derivative(self, z: Lanes, p: Parameters, v: Direction, w: Direction) -> Lanes:
        """D²F[v, w]."""
        return np.asarray(self._equations(z, p, v, w)[3])

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂p."""
        given, y = self._jets(z, p)
        q = normalised(given)[0]
        out = self._by_scalars(q, y)[0]
        slope = self._slope(q, y)[0]
        for side, node in enumerate((0, -1)):
            if self.model.held[side]:
                rows = self.model.turned[side]
                angles = np.einsum("ks,ls->lk", rows, y[0])
                for k in range(3):
                    change = np.stack([angles, np.zeros_like(angles)])
                    change[1, :, k] = 1.0
                    work = (clamp_rotation(change)[1] * slope[:, node]).sum(axis=1)
                    out = out + work[:, None] * rows[k]
        return np.ascontiguousarray(out[:, self.constraints : -1])

    def end_couples(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes 2 3"]:
        """Couples (x, y, z) of the supports on both ends; 0 at free rotations."""
        given, y = self._jets(z, p)
        q = normalised(given)[0]
        slope = self._slope(q, y)[0]
        out = [
            np.stack([0.5 * (product(unit, q[0][:, k]) * slope[:, k]).sum(axis=1)
                      for unit in np.eye(4)[1:]], axis=-1)
            for k in (0, -1)
        ]  # fmt: skip
        return np.stack(out, axis=1)

    def support_forces(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes 3"]:
        """Force of the support at A: multipliers, or what balances the loads."""
        return np.asarray(np.einsum("cs,ls->lc", self.model.reaction, self.scalars(z, p)))

    # --- the matrix -----------------------------------------------------------------------------

    @cached_property
    def layout(self) -> SparseLayout:
        """Sparsity of F_z: dense blocks of elements, and a border."""
        rows, columns = (np.concatenate(each) for each in zip(*self._places, strict=True))
        keys = np.unique(rows * self.size + columns)
        return SparseLayout(keys // self.size, keys % self.size, self.size, self.constraints)

    @cached_property
    def _places(self) -> list[tuple[Int[np.ndarray, " some"], Int[np.ndarray, " some"]]]:
        """Rows and columns, row ≥ column, of the blocks of the elements, then of the border."""
        first, count = self.model.unknown_nodes.start, self.unknowns // 4
        found = []
        for nodes in self.mesh.element_nodes:
            at = (4 * (nodes - first))[:, None] + np.arange(4)
            at = at[(nodes >= first) & (nodes < first + count)].ravel()
            rows, columns = np.meshgrid(at, at, indexing="ij")
            low = rows >= columns
            found.append((rows[low], columns[low]))
        m = np.arange(self.unknowns, self.size)
        rows, columns = np.meshgrid(m, np.arange(self.size), indexing="ij")
        low = rows >= columns
        return [*found, (rows[low], columns[low])]

    @cached_property
    def _slots(self) -> list[Int[np.ndarray, " some"]]:
        """Numbers of the entries of each of `_places`."""
        keys = self.layout.rows * self.size + self.layout.columns
        return [np.searchsorted(keys, r * self.size + c) for r, c in self._places]

    def entries(self, z: Lanes, p: Parameters, shift: Values | None = None) -> Entries:
        """Entries of F_z − shift·mass in the order of `layout`."""
        given, y = self._jets(z, p)
        q, inverse, square = (jet[0] for jet in normalised(given))
        blocks, crossing, closing = self._second(q, y)
        slope = self._slope(q[None], y)[0]
        projector = (np.eye(4) - q[..., :, None] * q[..., None, :]) * inverse[..., None, None]
        nodes = self.mesh.element_nodes
        p_left = projector[:, nodes]
        blocks = np.einsum("leiab,leibjc,lejcd->leiajd", p_left, blocks, p_left, optimize=True)
        own = self._own_blocks(given[0], q, inverse, square, slope)
        border = np.einsum("lmia,liab->lmib", crossing, projector)
        return self._place_entries(blocks, own, border, closing, shift)

    def _own_blocks(
        self, given: Nodes, q: Nodes, inverse: np.ndarray, square: np.ndarray, slope: Nodes
    ) -> Float[np.ndarray, "lanes nodes 4 4"]:
        """Blocks of the nodes by the change of directions and lengths."""
        along = (q * slope).sum(axis=-1)[..., None, None]
        across = slope - along[..., 0] * q
        mixed = across[..., :, None] * q[..., None, :]
        unit = np.eye(4)
        own = along * (unit - q[..., :, None] * q[..., None, :])
        own = -(own + mixed + np.swapaxes(mixed, -1, -2)) * (inverse**2)[..., None, None]
        inner = self.model.unknown_nodes
        excess = square[:, inner, None, None] - 1.0
        outer = given[:, inner, :, None] * given[:, inner, None, :]
        own[:, inner] += 0.5 * self._length[:, None, None] * (excess * unit + 2.0 * outer)
        return np.asarray(own)

    def _place_entries(
        self,
        blocks: np.ndarray,
        own: np.ndarray,
        border: np.ndarray,
        closing: np.ndarray,
        shift: Values | None,
    ) -> Entries:
        """Write blocks of elements and nodes, and the border, to their entries."""
        lanes, inner = len(blocks), self.model.unknown_nodes
        out = np.zeros((lanes, len(self.layout.rows)))
        count = len(self.mesh.nodes)
        free = np.zeros(count, bool)
        free[inner] = True
        for e, nodes in enumerate(self.mesh.element_nodes):
            mine = np.repeat(free[nodes], 4)
            block = blocks[:, e].reshape(lanes, len(mine), len(mine))[:, mine][:, :, mine]
            low = np.tril_indices(block.shape[1])
            out[:, self._slots[e]] += block[:, low[0], low[1]]
        slots = self._node_slots
        own = own[:, inner]
        if shift is not None:
            own[:, :, range(4), range(4)] -= shift[:, None, None] * self.mass.reshape(-1, 4)
        low = np.tril_indices(4)
        out[:, slots] += own[:, :, low[0], low[1]]
        m = self.constraints
        rows = np.zeros((lanes, m, self.size))
        rows[:, :, : self.unknowns] = border[:, :, inner].reshape(lanes, m, self.unknowns)
        rows[:, :, self.unknowns :] = closing
        r, c = self._places[-1]
        out[:, self._slots[-1]] = rows[:, r - self.unknowns, c]
        return out

    @cached_property
    def _node_slots(self) -> Int[np.ndarray, "nodes 10"]:
        """Numbers of the entries of the lower triangle of each node."""
        keys = self.layout.rows * self.size + self.layout.columns
        first = 4 * np.arange(self.unknowns // 4)[:, None]
        row, column = np.tril_indices(4)
        return np.searchsorted(keys, (first + row) * self.size + first + column)

    def _second(
        self, q: Nodes, y: Float[np.ndarray, "1 lanes scalars"]
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Second derivatives of L by unit quaternions of elements, by these and λ, and by λ."""
        turned, moved, strain = (jet[0] for jet in self.element_strains(q[None]))
        local = q[:, self.mesh.element_nodes]
        weights, model, m = self._weights[..., None], self.model, self.constraints
        order = local.shape[2]
        jacobian = 2.0 * np.einsum("eij,leika->leikja", self.slopes, turned)
        own = -2.0 * np.einsum("kab,leib->leika", RIGHT, moved)
        i = np.arange(order)
        jacobian[:, :, i, :, i] += np.moveaxis(own, 2, 0)
        torsion = np.einsum("ls,sei->lei", y[0], model.torsion)
        stiff = np.repeat((weights * model.stiffness)[None], len(q), axis=0)
        stiff[..., 0] += self._weights * torsion
        rows = jacobian.reshape(*jacobian.shape[:2], 3 * order, 4 * order)
        scaled = rows * stiff.reshape(*rows.shape[:3])[..., None]
        blocks = np.matmul(np.swapaxes(rows, -1, -2), scaled)
        blocks = blocks.reshape(*blocks.shape[:2], order, 4, order, 4)
        moment = 2.0 * weights * self.section_moments(strain[None], y)[0]
        skew = np.einsum("leik,kab->leiab", moment, RIGHT)
        mixed = np.einsum("eij,leiab->lejaib", self.slopes, skew)
        blocks = blocks + mixed + mixed.transpose(0, 1, 4, 5, 2, 3)
        pull, axial = (jet[0] for jet in self.section_forces(q[None], y))
        stretch = weights * self.stretches(axial[None], y)[0]
        force = np.einsum("ls,seic->leic", y[0], model.force)
        curved = 2.0 * np.einsum("leik,leic,kcab->leiab", stretch, force, FRAME, optimize=True)
        soft = weights * model.softness
        curved = curved - np.einsum("eik,leika,leikb->leiab", soft, pull, pull, optimize=True)
        blocks[:, :, i, :, i] += np.moveaxis(curved, 2, 0)
        sided = np.einsum("meic,kcab,leib->lmeika", model.force[:m], FRAME, local, optimize=True)
        ahead = np.einsum("lmeika,leia->lmeik", sided, local)
        crossing = 2.0 * np.einsum("leik,lmeika->lmeia", stretch, sided)
        crossing -= np.einsum("eik,lmeik,leika->lmeia", soft, ahead, pull, optimize=True)
        closing = model.quadratic[:m, :m] - np.einsum(
            "eik,lmeik,lneik->lmn", soft, ahead, ahead, optimize=True
        )
        return blocks, self._assemble(crossing), closing

    def solve(
        self,
        z: Lanes,
        p: Parameters,
        rhs: Float[np.ndarray, "lanes sides bordered"],
        border: Border | None = None,
        shift: Values | None = None,
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass, bordered."""
        return self.layout.solve(self.entries(z, p, shift), border, rhs)

    def _linearised(self, z: Lanes, p: Parameters, dp: Parameters) -> tuple[Lanes, Lanes, Entries]:
        residual, column = self._equations(z, p, (np.zeros_like(z), dp))
        return residual, column, self.entries(z, p)

    def linear_system(
        self, z: Lanes, p: Parameters, directions: Float[np.ndarray, "lanes k parameters"]
    ) -> LinearSystem:
        """F, F_p along directions, and solves with F_z; computed together."""
        return joint_system(self._linearised, self._solve, z, p, directions)

    def _solve(
        self,
        z: Lanes,
        p: Parameters,
        entries: Entries,
        rhs: Float[np.ndarray, "lanes sides bordered"],
        border: Border | None,
    ) -> BorderedSolution:
        """Solve with F_z, given by its entries, bordered."""
        del z, p
        return self.layout.solve(entries, border, rhs)

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One Newton step along the curve with parameter velocity `dp`."""
        system = self.linear_system(z, p, dp[:, None])
        return advance_by(system, row, corner, defect, self.constraints)

    # --- guesses --------------------------------------------------------------------------------

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Rotations between those of the ends, turned by random waves, with random multipliers."""
        lanes, s, modes = len(p), self.mesh.nodes, np.arange(1, 7)
        amplitude = generator.normal(size=(lanes, len(modes), 3)) * (3.0 / modes)[:, None]
        amplitude *= generator.uniform(size=(lanes, 1, 1))
        start, stop = self.model.held
        if start and stop:
            waves = np.sin(np.pi * np.outer(s, modes))
        else:
            waves = np.sin(np.pi * np.outer(s if start else 1.0 - s, modes - 0.5))
        turns = exponential(np.einsum("nm,lmk->lnk", waves, amplitude))
        q = product(self.between(p), turns)[:, self.model.unknown_nodes]
        forces = generator.normal(size=(lanes, self.constraints)) * FORCES
        return np.concatenate([q.reshape(lanes, self.unknowns), forces], axis=1)

    def between(self, p: Parameters) -> Nodes:
        """Rotations with the angles of clamps, linear in s between two of them."""
        y = np.concatenate([np.zeros((len(p), self.constraints)), p, np.ones((len(p), 1))], axis=1)
        ends = np.einsum("eks,ls->lek", self.model.turned, y)
        start, stop = self.model.held
        if not (start and stop):
            ends = np.repeat(ends.sum(axis=1, keepdims=True), 2, axis=1)
        s = self.mesh.nodes[:, None]
        angles = ends[:, :1] * (1.0 - s) + ends[:, 1:] * s
        return np.asarray(clamp_rotation(angles[None])[0])

    def tail(self, z: Lanes, p: Parameters) -> Values:
        """Largest of the two highest Legendre coefficients of q in all elements."""
        coefficients = np.einsum("cn,lna->lca", self.mesh.highest, self.rotations(z, p))
        return np.asarray(np.abs(coefficients).max(axis=(1, 2)))

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether the rotations are smooth in every element."""
        return np.asarray(self.tail(z, p) < LARGEST_TAIL)
