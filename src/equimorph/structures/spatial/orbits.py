"""Rods between coaxial clamps without a phase condition, which have orbits at some parameters.

See docs/decisions.md, "Orbits".
"""

from dataclasses import replace
from functools import cached_property, partial

import numpy as np

from equimorph.arrays import Flags, Float, Lanes, Parameters, Sides, Values
from equimorph.linalg import BorderedSolution
from equimorph.structures.equations import Advance, AnyBorder, Equations, Force, Shift
from equimorph.structures.spatial.mechanics import SpatialMechanics
from equimorph.structures.spatial.phase import PinnedMechanics
from equimorph.structures.spatial.phase_condition import breaking_scalars, with_phase_condition

NEAR_AXIS = 1e-12
"""Angles, places and loads across the axis that are none: round-off of the way to them."""


class OrbitMechanics(SpatialMechanics):
    """Mechanics of a rod that has orbits at some parameters.

    There, a state off the axis is turned to the phase condition, steps and solves are those of the
    rod with it, and what they give is turned back: the phase stays, μ is 0. Paths along which the
    orbits stay begin on the condition and stay there: predictors would amplify a phase that
    nothing corrects. Elsewhere all is as for other rods.
    """

    @cached_property
    def pinned(self) -> PinnedMechanics:
        """The rod with the phase condition."""
        return PinnedMechanics(with_phase_condition(self.model))

    @cached_property
    def _breaking(self) -> Float[np.ndarray, "some others"]:
        return np.ascontiguousarray(breaking_scalars(self.model)[:, self.constraints :])

    def have_orbits(self, p: Parameters, *, moving: bool = False) -> Flags:
        """Whether states at parameters, or along directions (moving), may be turned about x."""
        given = np.concatenate([p, np.full((len(p), 1), 0.0 if moving else 1.0)], axis=1)
        across = np.abs(given @ self._breaking.T).max(axis=1, initial=0.0)
        angles = given @ self.model.turned[:, 0, self.constraints :].T
        if not moving:  # turned all round, a clamp is the same again
            angles -= 2.0 * np.pi * np.round(angles / (2.0 * np.pi))
        return np.asarray(np.maximum(across, np.abs(angles).max(axis=1)) <= NEAR_AXIS)

    def on_orbits(self, z: Lanes, p: Parameters) -> Flags:
        """Whether states could be turned about the x axis, and would move."""
        symmetric = self.have_orbits(p)
        if symmetric.any():
            symmetric[symmetric] = ~self.pinned.on_axis(self._widen(z[symmetric]))
        return symmetric

    def along_orbits(self, z: Lanes, p: Parameters) -> Lanes:
        """ξ of states that may be turned, 0 of others."""
        around = self.pinned.velocity(self._widen(z))[:, :-1]
        return np.where(self.on_orbits(z, p)[:, None], around, 0.0)

    def pick_on_orbits(self, z: Lanes, p: Parameters, towards: Parameters) -> Lanes:
        """States with the phase condition, where orbits lead on to other parameters."""
        there = self.on_orbits(z, p) & self.have_orbits(towards)
        if not there.any():
            return z
        out = z.copy()
        out[there] = self.pinned.aligned(self._widen(z[there]))[:, :-1]
        return out

    def _widen(self, z: np.ndarray) -> np.ndarray:
        """Unknowns, rows or columns with a 0 for μ."""
        return np.insert(z, self.size, 0.0, axis=-1)

    def advance(
        self, z: Lanes, p: Parameters, dp: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One Newton step along the curve with parameter velocity `dp`."""
        there = self.on_orbits(z, p)
        if not there.any():
            return super().advance(z, p, dp, row, corner, defect)
        own, by = self._widen(z[there]), self.pinned.turn
        along = self.have_orbits(dp[there], moving=True) & dp[there].any(axis=1)
        angle = np.where(along, 0.0, self.pinned.phase(own))
        rows = by(self._widen(row[there]), -angle)
        step = self.pinned.advance(
            by(own, -angle), p[there], dp[there], rows, corner[there], defect[there]
        )
        moves = (by(each, angle)[:, :-1] for each in (step.dz, step.tangent_z))
        found = replace(step, **dict(zip(("dz", "tangent_z"), moves, strict=True)))
        if there.all():
            return found
        rest = super().advance(*(each[~there] for each in (z, p, dp, row, corner, defect)))
        return Advance(**_merge(there, vars(found), vars(rest)))

    def advance_under(
        self, force: Force, z: Lanes, p: Parameters, row: Lanes, corner: Values, defect: Values
    ) -> Advance:
        """One Newton step under a force; the general one where states could be turned."""
        there = self.on_orbits(z, p)
        if not there.any():
            return super().advance_under(force, z, p, row, corner, defect)
        given = z, p, row, corner, defect
        found, rest = (
            step((force[0][some], force[1][some]), *(each[some] for each in given))
            for step, some in ((partial(Equations.advance_under, self), there),
                               (super().advance_under, ~there))
        )  # fmt: skip
        return Advance(**_merge(there, vars(found), vars(rest)))

    def solve(
        self, z: Lanes, p: Parameters, rhs: Sides, border: AnyBorder = None, shift: Shift = None
    ) -> BorderedSolution:
        """Solve with F_z − shift·mass, bordered."""
        there = self.on_orbits(z, p)
        if not there.any():
            return super().solve(z, p, rhs, border, shift)
        own = self._widen(z[there])
        angle = self.pinned.phase(own)
        turn = partial(self._turn_parts, angle)
        around = None
        if border is not None:
            columns, rows, corner = (each[there] for each in border)
            around = turn(columns, 1.0), turn(rows, 1.0), corner
        shifts = None if shift is None else shift[there]
        at = self.pinned.turn(own, -angle)
        found = self.pinned.solve(at, p[there], turn(rhs[there], 1.0), around, shifts)
        x = np.delete(turn(found.x, -1.0, self.size + 1), self.size, axis=-1)
        found = replace(found, x=x, negative=found.negative - 1)
        if there.all():
            return found
        outer = None if border is None else tuple(each[~there] for each in border)
        rest = super().solve(z[~there], p[~there], rhs[~there], outer,
                             None if shift is None else shift[~there])  # fmt: skip
        return BorderedSolution(**_merge(there, vars(found), vars(rest)))

    def _turn_parts(
        self,
        angle: Values,
        parts: Float[np.ndarray, "lanes k wide"],
        sign: float,
        size: int | None = None,
    ) -> np.ndarray:
        """Right-hand sides, rows or solutions, turned to the condition (1) or back (−1)."""
        lanes, k = parts.shape[:2]
        if size is None:
            size = self.size
            parts = np.insert(parts, size, 0.0, axis=-1)
            size += 1
        out = parts.copy()
        flat = parts[..., :size].reshape(lanes * k, size)
        out[..., :size] = self.pinned.turn(flat, -sign * angle.repeat(k)).reshape(lanes, k, size)
        return out


def _merge(
    there: Flags, found: dict[str, np.ndarray], rest: dict[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Lanes of two parts in their order."""
    merged = {name: np.empty((len(there), *each.shape[1:]), each.dtype)
              for name, each in found.items()}  # fmt: skip
    for name, out in merged.items():
        out[there], out[~there] = found[name], rest[name]
    return merged
