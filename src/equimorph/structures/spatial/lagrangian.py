"""The Lagrangian of a rod in space and its derivatives, by jets, in batches.

z = (q₁, q₂, …; λ): four entries a node whose rotation is unknown, then the multipliers. The
rotation of a node is q/|q|, so that z + dz is a state for every dz; the energy ½ k m (|q|² − 1)²
keeps lengths at 1, and is zero at equilibria. See docs/decisions.md, "Rotations in space".
"""

from functools import cached_property, partial
from typing import Any

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Parameters, Scalars, Values
from equimorph.structures.contract import Symmetry
from equimorph.structures.equations import Direction
from equimorph.structures.rod.mechanics import RodMechanics
from equimorph.structures.rod.reflections import Reflection, find_symmetries
from equimorph.structures.spatial.model import SpatialModel
from equimorph.structures.spatial.planar import PlanarPart
from equimorph.structures.spatial.quaternions import (
    FRAME,
    Jet,
    apply,
    are_near,
    bilinear,
    clamp_rotation,
    combine,
    element_slopes,
    exponential,
    gather,
    normalise,
    product,
    strains,
    turn_about,
)
from equimorph.structures.spatial.windings import (
    FLATTER,
    WINDING,
    most_windings,
    random_axes,
    random_windings,
)

LENGTH_STIFFNESS = 100.0
"""k: lengths of quaternions are the stiffer in the metric, the nearer Newton's steps are to those
on the rotations; margins of states are known below it."""
LARGEST_TAIL = 5e-4
"""Highest Legendre coefficients of q, half of radians, of an element that represents its part."""
WHOLE_TURNS = np.array([0.0, -1.0, 1.0, -2.0, 2.0])
"""Turns by 4π of guesses, which clamps do not see."""
FORCES = 8.0
"""Spread of the support forces of random guesses."""
PLANES = np.array([1, 2, 2, 0, 0, 0])
"""Axes of the cross-section, n or b, about which random guesses of some kinds bend in a plane; 0:
about all. Most of the first bend in that of the drawing."""

Nodes = Float[np.ndarray, "lanes nodes 4"]


class SpatialLagrangian(RodMechanics):
    """The Lagrangian of a `SpatialModel`; methods as in `structures.contract`."""

    def __init__(self, model: SpatialModel) -> None:
        self.model, self.mesh = model, model.mesh
        self.parameters, self.constraints = len(model.names), model.multipliers
        inner = model.unknown_nodes
        self.slopes = self.mesh.reference.derivative / self.mesh.lengths[:, None, None]
        self.weights = self.mesh.element_weights
        self.stiff_lengths = LENGTH_STIFFNESS * 4.0 * self.mesh.weights[inner]
        self.mass = np.repeat(4.0 * self.mesh.weights[inner], 4)
        self.unknowns = len(self.mass)

    # --- scalars and rotations ------------------------------------------------------------------

    def scalars(self, z: Lanes, p: Parameters) -> Scalars:
        """Multipliers, parameters and 1."""
        self.check_widths((z, p))
        return np.concatenate([z[:, self.unknowns :], p, np.ones((len(z), 1))], axis=1)

    def jets(
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
        q = self.jets(z, p)[0][0]
        return np.asarray(q / np.linalg.norm(q, axis=-1, keepdims=True))

    # --- the Lagrangian in unit quaternions -----------------------------------------------------

    def element_strains(self, q: Jet) -> tuple[Jet, Jet, Jet]:
        """q e_k and q' at the nodes of every element, and u."""
        return strains(self.slopes, q[:, :, self.mesh.element_nodes])

    def section_forces(self, q: Jet, y: Jet) -> tuple[Jet, Jet]:
        """∂a_k/∂q and a_k: of the force on the cross-section, on its axes."""
        local = q[:, :, self.mesh.element_nodes]
        force = np.einsum("pls,seic->pleic", y, self.model.force)

        def pull(f: np.ndarray, at: np.ndarray) -> np.ndarray:
            return np.asarray(np.einsum("...c,kcab,...b->...ka", f, FRAME, at, optimize=True))

        slope = 2.0 * bilinear(pull, force, local)
        return slope, 0.5 * bilinear(apply, slope, local)

    def stretches(self, axial: Jet, y: Jet) -> Jet:
        """∂L/∂a_k over the weights: 1 + extension, and shears."""
        pull = np.zeros_like(axial)
        pull[..., 0] = np.einsum("pls,sei->plei", y, self.model.tension)
        out = -self.model.softness * (axial + pull)
        out[0, ..., 0] += 1.0
        return np.asarray(out)

    @property
    def is_extensible(self) -> bool:
        """Whether the axis stretches."""
        return bool(self.model.softness[..., 0].any())

    def section_moments(self, strain: Jet, y: Jet) -> Jet:
        """Moments on the axes of the cross-section."""
        out = self.model.stiffness * strain
        out = out - np.einsum("pls,seik->pleik", y, self.model.moment)
        torsion = np.einsum("pls,sei->plei", y, self.model.torsion)
        out[..., 0] += bilinear(np.multiply, torsion, strain[..., 0])
        return np.asarray(out)

    def slope(self, q: Jet, y: Jet) -> Jet:
        """Gradient of L by unit quaternions at all nodes."""
        turned, moved, strain = self.element_strains(q)
        weights = self.weights[..., None]
        moment = weights * self.section_moments(strain, y)
        pull, axial = self.section_forces(q, y)
        stretch = weights * self.stretches(axial, y)
        local = element_slopes(self.slopes, turned, moved, moment)
        local = local + bilinear(combine, stretch, pull)
        nodes = self.mesh.element_nodes
        flat = local.reshape(*local.shape[:2], nodes.size, 4)
        return gather(flat, nodes.ravel(), len(self.mesh.nodes))

    def by_scalars(self, q: Jet, y: Jet) -> Jet:
        """∂L/∂y at fixed rotations."""
        _, _, strain = self.element_strains(q)
        _, axial = self.section_forces(q, y)
        weights = self.weights[..., None]
        stretch = weights * self.stretches(axial, y)
        local, model = q[:, :, self.mesh.element_nodes], self.model

        def turn(a: np.ndarray, b: np.ndarray) -> np.ndarray:
            return np.asarray(np.einsum("...a,kcab,...b->...kc", a, FRAME, b, optimize=True))

        frames = bilinear(turn, local, local)
        pointing = bilinear(combine, stretch, frames)
        out = np.einsum("pleic,seic->pls", pointing, model.force)
        out = out - np.einsum("pleik,seik->pls", weights * strain, model.moment)
        twisting = 0.5 * self.weights * bilinear(np.multiply, strain[..., 0], strain[..., 0])
        out = out + np.einsum("plei,sei->pls", twisting, model.torsion)
        shortening = stretch[..., 0].copy()
        shortening[0] -= self.weights
        out = out + np.einsum("plei,sei->pls", shortening, model.tension)
        return np.asarray(out + np.einsum("pls,st->plt", y, model.quadratic))

    # --- contract -------------------------------------------------------------------------------

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂p."""
        given, y = self.jets(z, p)
        q = normalise(given)[0]
        out = self.by_scalars(q, y)[0]
        slope = self.slope(q, y)[0]
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
        given, y = self.jets(z, p)
        q = normalise(given)[0]
        slope = self.slope(q, y)[0]
        out = [
            np.stack([0.5 * (product(unit, q[0][:, k]) * slope[:, k]).sum(axis=1)
                      for unit in np.eye(4)[1:]], axis=-1)
            for k in (0, -1)
        ]  # fmt: skip
        return np.stack(out, axis=1)

    def support_forces(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes 3"]:
        """Force of the support at A: multipliers, or what balances the loads."""
        return np.asarray(np.einsum("cs,ls->lc", self.model.reaction, self.scalars(z, p)))

    # --- guesses --------------------------------------------------------------------------------

    def sample(self, p: Parameters, generator: np.random.Generator) -> Lanes:
        """Rotations between those of the ends, turned by random waves, with random multipliers.

        Half of them are those to which a rod leads that can only bend in a plane: states that stay
        in one are common, and of the other guesses one in thousands leads to some of them. Between
        two clamps some wind about an axis.
        """
        lanes, s, modes = len(p), self.mesh.nodes, np.arange(1, 7)
        amplitude = generator.normal(size=(lanes, len(modes), 3)) * (3.0 / modes)[:, None]
        amplitude *= generator.uniform(size=(lanes, 1, 1))
        start, stop = self.model.held
        if start and stop:
            waves = np.sin(np.pi * np.outer(s, modes))
        else:
            waves = np.sin(np.pi * np.outer(s if start else 1.0 - s, modes - 0.5))
        forces = generator.normal(size=(lanes, self.constraints)) * FORCES
        axis = PLANES[generator.integers(len(PLANES), size=lanes)]
        windings = random_windings(self.most_windings, axis > 0, generator)
        amplitude[windings != 0] *= FLATTER
        turns = exponential(np.einsum("nm,lmk->lnk", waves, amplitude))
        between = self.between(p)
        q = product(between, turns)
        wound = np.flatnonzero((axis == 0) & (windings != 0))
        if len(wound):
            along = WINDING * np.outer(windings[wound], s)
            around = turn_about(along[None], random_axes(len(wound), generator)[:, None])[0]
            q[wound] = product(product(between[wound], around), turns[wound])
        for part in self._planar_parts:
            some = np.flatnonzero((axis == part.axis) & (windings == part.windings))
            if len(some):
                q[some], forces[some] = part.bend(between[some], p[some], generator)
        q = q[:, self.model.unknown_nodes]
        return np.concatenate([q.reshape(lanes, self.unknowns), forces], axis=1)

    @cached_property
    def most_windings(self) -> int:
        """Windings of guesses; nothing keeps those of a rod with one clamp."""
        mesh = self.mesh
        return most_windings(mesh.elements, mesh.degree) if all(self.model.held) else 0

    @cached_property
    def _planar_parts(self) -> tuple[PlanarPart, ...]:
        most = self.most_windings
        return tuple(
            PlanarPart(self.model, axis, windings)
            for axis in np.unique(PLANES[PLANES > 0])
            for windings in range(-most, most + 1)
        )

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

    def with_whole_turns(self, p: Parameters) -> Float[np.ndarray, "guesses lanes size"]:
        """Rotations `between` the clamps, with turns about the tangent that the clamps do not see.

        By 4π: a turn by 2π changes the sign of the quaternion of a clamp. Between coaxial clamps
        these are straight, and equilibria of round rods.
        """
        turns = np.zeros((len(WHOLE_TURNS), 1, len(self.mesh.nodes), 3))
        turns[:, 0, :, 0] = 4.0 * np.pi * WHOLE_TURNS[:, None] * self.mesh.nodes
        if not all(self.model.held):
            turns = turns[:0]
        q = product(self.between(p)[None], exponential(turns))[:, :, self.model.unknown_nodes]
        out = np.zeros((len(turns), len(p), self.size))
        out[:, :, : self.unknowns] = q.reshape(len(turns), len(p), self.unknowns)
        return out

    def guess_for(self, finer: Any, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes finer"]:
        """States as guesses of those of the same rod with other elements."""
        matrix = self.mesh.interpolation(finer.mesh.nodes[finer.model.unknown_nodes])
        nodal = np.einsum("mn,lna->lma", matrix, self.rotations(z, p))
        nodal /= np.linalg.norm(nodal, axis=-1, keepdims=True)
        return np.concatenate([nodal.reshape(len(z), -1), z[:, self.unknowns :]], axis=1)

    def tail(self, z: Lanes, p: Parameters) -> Values:
        """Largest of the two highest Legendre coefficients of q in all elements."""
        coefficients = np.einsum("cn,lna->lca", self.mesh.highest, self.rotations(z, p))
        return np.asarray(np.abs(coefficients).max(axis=(1, 2)))

    def resolved(self, z: Lanes, p: Parameters) -> Flags:
        """Whether the rotations are smooth in every element."""
        return np.asarray(self.tail(z, p) < LARGEST_TAIL)

    def may_resolve(self, z: Lanes, p: Parameters) -> Flags:
        """Whether rotations jump nowhere in an element."""
        return are_near(self.rotations(z, p)[:, self.mesh.element_nodes])

    def symmetries(self) -> tuple[Symmetry, ...]:
        """Mirror images and half turns that leave the Lagrangian as it is."""
        return symmetries(self.model, self.unknowns)


HALF_TURN = "half turn about x"
CANDIDATES = (
    Reflection("mirror", np.array([-1.0, 1.0, 1.0])),
    Reflection("sideways mirror", np.array([1.0, 1.0, -1.0])),
    Reflection("half turn about y", np.array([-1.0, 1.0, -1.0])),
    Reflection("reflection", np.array([1.0, -1.0, 1.0])),
    Reflection("half turn about z", np.array([-1.0, -1.0, 1.0])),
    Reflection(HALF_TURN, np.array([1.0, -1.0, -1.0])),
    Reflection("inversion", np.array([-1.0, -1.0, -1.0])),
)


def symmetries(model: SpatialModel, unknowns: int) -> tuple[Symmetry, ...]:
    """Symmetries among the `CANDIDATES` that the rod has.

    With a reflection M = diag(±1, ±1, ±1) a state R(s) has the image M R M, taken at s or at 1 − s:
    the latter where M turns x round. Its strains are ± det(M) M u, its tangents ± M t with + at s.
    """
    tables = [(each, each[::-1, ::-1]) for each in (model.stiffness, model.softness)]
    features = partial(_features, model)
    return find_symmetries(model, unknowns, CANDIDATES, features, _image, tables)


def _axial(by: Reflection) -> Float[np.ndarray, "3"]:
    """Signs of the vector part of quaternions, and of the angles twist, tilt, theta."""
    return np.asarray(by.signs.prod() * by.signs)


def _image(by: Reflection, unknowns: Lanes) -> Lanes:
    lanes, size = unknowns.shape
    q = unknowns.reshape(lanes, size // 4, 4)[:, :: by.step] * np.append(1.0, _axial(by))
    return np.asarray(q.reshape(lanes, size))


def _features(model: SpatialModel, by: Reflection) -> Float[np.ndarray, "scalars some"]:
    """Coefficients of all scalars, in the image of the rod."""
    rows, step = np.s_[:, :: by.step, :: by.step], by.step
    weights = model.mesh.element_weights[..., None]
    turned = _axial(by)[::-1, None] * model.turned[::step]
    parts = (
        (weights * model.force)[rows] * (step * by.signs),
        (weights * model.moment)[rows] * (step * _axial(by)),
        (weights[..., 0] * model.tension)[rows],
        (weights[..., 0] * model.torsion)[rows],
        np.moveaxis(turned, -1, 0),
    )
    return np.concatenate([each.reshape(model.scalars, -1) for each in parts], axis=1)
