"""The Lagrangian of a frame in space and its derivatives, by jets, in batches.

z = (q₁, q₂, …; φ₁, …; λ): four entries a free node, whose turn is q/|q|, the angles of hinges, and
the multipliers. As for rods in space, ½ k m (|q|² − 1)² keeps lengths at 1; see docs/decisions.md,
"Rotations in space".
"""

from functools import cached_property

import numpy as np

from equimorph.arrays import Float, Lanes, Parameters, Scalars
from equimorph.errors import InputError
from equimorph.structures.equations import Direction
from equimorph.structures.space_frame.model import SpatialFrameModel
from equimorph.structures.spatial.quaternions import (
    FRAME,
    Jet,
    bilinear,
    conjugate,
    dot,
    element_slopes,
    gather,
    normalise,
    product,
    strains,
    turn_about,
)
from equimorph.structures.whole_turns import WholeTurns


class SpatialFrameLagrangian:
    """The Lagrangian of a `SpatialFrameModel`; methods as in `structures.contract`."""

    def __init__(self, model: SpatialFrameModel) -> None:
        self.model = model
        self.unknowns, self.constraints = model.unknowns, model.multipliers
        self.mass = model.mass
        self._slopes = model.mesh.reference.derivative / model.element_lengths[:, None, None]
        self._rows = 4 * len(model.free)

    # --- scalars and rotations ------------------------------------------------------------------

    def scalars(self, z: Lanes, p: Parameters) -> Scalars:
        """Multipliers, parameters and 1."""
        size = self.unknowns + self.constraints
        for name, given, width in (("z", z, size), ("p", p, self.model.patterns.count)):
            if given.shape[1] != width:
                raise InputError(
                    f"`{name}` must have {width} columns; got shape {given.shape}. States belong "
                    "to the frame, and the resolution, that made them."
                )
        return np.concatenate([z[:, self.unknowns :], p, np.ones((len(z), 1))], axis=1)

    @cached_property
    def whole_turns(self) -> WholeTurns:
        """Turns by 4π of each hinge: rotations are doubly covered."""
        turns = np.eye(self.unknowns, self.unknowns + self.constraints)[self._rows :]
        return WholeTurns(4.0 * np.pi * turns, turns[:0])

    def quaternions(self, z: Lanes) -> Float[np.ndarray, "lanes free 4"]:
        """Quaternions of the free nodes."""
        return z[:, : self._rows].reshape(len(z), len(self.model.free), 4)

    def held_turns(self, y: Jet) -> Float[np.ndarray, "parts lanes held 4"]:
        """Turns of what supports hold: about the axes of the parameters, one after the other."""
        model = self.model
        out = np.zeros((*y.shape[:2], len(model.held), 4), y.dtype)
        out[0, ..., 0] = 1.0
        vectors = model.patterns.turns[:, model.held]
        for k in range(model.patterns.count):
            for h in np.flatnonzero(vectors[k].any(axis=1)):
                size = float(np.linalg.norm(vectors[k, h]))
                angle = size * y[..., model.multipliers + k]
                more = turn_about(angle, vectors[k, h] / size)
                out[:, :, h] = bilinear(product, out[:, :, h], more)
        return out

    def jets(self, z: Lanes, p: Parameters, *directions: Direction) -> tuple[Jet, Jet, Jet, Jet]:
        """Quaternions of free nodes, unit ones at all nodes, angles of hinges, and scalars."""
        model, parts = self.model, 2 ** len(directions)
        y = np.zeros((parts, *self.scalars(z, p).shape), np.result_type(z, p))
        y[0] = self.scalars(z, p)
        q = np.zeros((parts, len(z), len(model.free), 4), y.dtype)
        q[0] = self.quaternions(z)
        angles = np.zeros((parts, len(z), len(model.hinged)), y.dtype)
        angles[0] = z[:, self._rows : self.unknowns]
        for k, (dz, dp) in enumerate(directions, 1):
            y[k, :, :-1] = np.concatenate([dz[:, self.unknowns :], dp], axis=1)
            q[k], angles[k] = self.quaternions(dz), dz[:, self._rows : self.unknowns]
        w = np.zeros((parts, len(z), len(model.turning), 4), y.dtype)
        w[:, :, model.free] = normalise(q)[0]
        w[:, :, model.held] = self.held_turns(y)
        turned = turn_about(angles, model.hinge_axes)
        w[:, :, model.hinged] = bilinear(product, w[:, :, model.parents], turned)
        return q, w, angles, y

    def turns(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes nodes 4"]:
        """Unit quaternions at all nodes: turns from where they are drawn."""
        return np.asarray(self.jets(z, p)[1][0])

    # --- elements -------------------------------------------------------------------------------

    def strains(self, w: Jet) -> tuple[Jet, Jet, Jet]:
        """w e_k and w' at the points, and the strains v on fixed axes."""
        return strains(self._slopes, w[:, :, self.model.nodes])

    def actuated_strains(self, y: Jet) -> tuple[Jet, Jet]:
        """Strains of the cross-sections, and elongations, that are free of stress, by piece."""
        own = y[..., self.model.multipliers :]
        strain = np.einsum("plc,kca->plka", own, self.model.strains)
        return strain, np.einsum("plc,kc->plk", own, self.model.elongation)

    def forces(self, y: Jet) -> Float[np.ndarray, "parts lanes elements order 3"]:
        """Forces in the cross-sections at the points."""
        acting, owner = self.model.acting, self.model.owner
        here = y[..., acting.numbers]
        some = np.arange(acting.numbers.shape[1]) < acting.counts[:, None]
        here = np.where(some, here, 0.0)
        start = np.einsum("plkr,kra->plka", here, acting.start)[:, :, owner]
        drop = np.einsum("plkr,kra->plka", here, acting.drop)[:, :, owner]
        return np.asarray(
            start[:, :, :, None] - drop[:, :, :, None] * self.model.arclengths[..., None]
        )

    def point_moments(self, v: Jet, y: Jet) -> Jet:
        """Moments on fixed axes at the points, turned back with the cross-sections."""
        strain = self.actuated_strains(y)[0][:, :, self.model.owner]
        free = np.einsum("eiak,plek->pleia", self.model.moment_of_strain, strain)
        return np.asarray(np.einsum("eiab,pleib->pleia", self.model.stiff, v) - free)

    def tensions(self, w: Jet, y: Jet) -> tuple[Jet, Jet, Jet]:
        """∂N/∂w and N at the points, and the stretch 1 + e + c N."""
        model = self.model
        local, force = w[:, :, model.nodes], self.forces(y)

        def by_force(f: np.ndarray, at: np.ndarray) -> np.ndarray:
            axes = np.einsum("eik,kcab->eicab", model.tangents, FRAME)
            form = np.einsum("...eic,eicab->...eiab", f, axes, optimize=True)
            return np.asarray(np.einsum("...ab,...b->...a", form, at))

        slope = 2.0 * bilinear(by_force, force, local)
        tension = 0.5 * bilinear(dot, slope, local)
        stretch = model.compliance[model.owner][:, None] * tension
        stretch = stretch + self.actuated_strains(y)[1][:, :, model.owner, None]
        stretch[0] += 1.0
        return slope, tension, stretch

    def element_slopes(self, w: Jet, y: Jet) -> Jet:
        """Gradient of L by unit quaternions at the points, element by element."""
        turned, moved, v = self.strains(w)
        weights = self.model.weights[..., None]
        pull, _, stretch = self.tensions(w, y)
        local = element_slopes(self._slopes, turned, moved, weights * self.point_moments(v, y))
        return np.asarray(local - weights * bilinear(_scale, stretch, pull))

    def slope(self, w: Jet, y: Jet) -> Jet:
        """Gradient of L by unit quaternions at all nodes."""
        local = self.element_slopes(w, y)
        flat = local.reshape(*local.shape[:2], self.model.nodes.size, 4)
        return gather(flat, self.model.nodes.ravel(), len(self.model.turning))

    def chords(self, w: Jet, y: Jet) -> Float[np.ndarray, "parts lanes elements order 3"]:
        """Vectors along the member at the points: stretch times tangent times weight."""
        model, local = self.model, w[:, :, self.model.nodes]
        axes = np.einsum("eik,kcab->eicab", model.tangents, FRAME)

        def turn(a: np.ndarray, b: np.ndarray) -> np.ndarray:
            return np.asarray(np.einsum("...eia,eicab,...eib->...eic", a, axes, b, optimize=True))

        tangent, stretch = bilinear(turn, local, local), self.tensions(w, y)[2]
        return np.asarray(model.weights[..., None] * bilinear(_scale, stretch, tangent))

    def by_scalars(self, w: Jet, y: Jet) -> Jet:
        """∂L/∂y at fixed rotations."""
        model, m = self.model, self.constraints
        chords, acting = self.chords(w, y), model.acting
        first = gather(chords.sum(axis=3), model.owner, model.pieces)
        moments = (chords * model.arclengths[..., None]).sum(axis=3)
        second = gather(moments, model.owner, model.pieces)
        work = np.einsum("plka,kra->plkr", first, acting.start)
        work = work - np.einsum("plka,kra->plkr", second, acting.drop)
        some = np.arange(acting.numbers.shape[1]) < acting.counts[:, None]
        of_scalars = gather(work[:, :, some][..., None], acting.numbers[some], model.scalars)
        out = np.einsum("pls,st->plt", y, model.quadratic) - of_scalars[..., 0]
        _, _, v = self.strains(w)
        weighted = np.einsum(
            "eiak,pleia->plek", model.moment_of_strain * model.weights[..., None, None], v
        )
        bending = np.einsum("plek,eck->plc", weighted, model.strains[model.owner])
        out[..., m:] -= bending
        tension = (model.weights * self.tensions(w, y)[1]).sum(axis=3)
        out[..., m:] -= np.einsum("ple,ec->plc", tension, model.elongation[model.owner])
        return np.asarray(out)

    # --- contract -------------------------------------------------------------------------------

    def lean_on_parents(self, slope: Jet, w: Jet, angles: Jet) -> Jet:
        """Add the slopes at hinged nodes to those of their parents; slopes by the angles."""
        model = self.model
        turned = turn_about(angles, model.hinge_axes)
        here = slope[:, :, model.hinged]
        axes = np.pad(model.hinge_axes, ((0, 0), (1, 0)))
        rate = np.stack(
            [product(part, np.broadcast_to(axes, part.shape)) for part in w[:, :, model.hinged]]
        )
        by_angle = 0.5 * bilinear(dot, here, rate)
        leaning = bilinear(product, here, conjugate(turned))
        slope += gather(leaning, model.parents, len(model.turning))
        return by_angle

    def effort(self, z: Lanes, p: Parameters) -> Parameters:
        """∂L/∂p: what actuators bear, and minus the travel of loads."""
        model = self.model
        _, w, angles, y = self.jets(z, p)
        out = self.by_scalars(w, y)[0][:, self.constraints : -1].copy()
        slope = self.slope(w, y)
        self.lean_on_parents(slope, w, angles)
        for k in range(model.patterns.count):
            if model.patterns.turns[k].any():
                change = np.stack([y[0], np.zeros_like(y[0])])
                change[1, :, self.constraints + k] = 1.0
                rate = self.held_turns(change)[1]
                out[:, k] += dot(rate, slope[0][:, model.held]).sum(axis=1)
        return np.asarray(out)

    def body_couples(self, z: Lanes, p: Parameters) -> Float[np.ndarray, "lanes nodes 3"]:
        """Couple (x, y, z) by which each node resists turning: that of its support if held."""
        _, w, angles, y = self.jets(z, p)
        slope = self.slope(w, y)
        self.lean_on_parents(slope, w, angles)
        units = np.eye(4)[1:]
        turned = [product(np.broadcast_to(unit, w[0].shape), w[0]) for unit in units]
        return np.stack([0.5 * dot(each, slope[0]) for each in turned], axis=-1)


def _scale(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray(a[..., None] * b)
