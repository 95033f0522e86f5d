"""The natural state of the arch: unloaded, continued from the straight rod."""

import numpy as np
from jaxtyping import Bool, Float

from equimorph.structures.rod.mechanics import RodMechanics

Lanes = Float[np.ndarray, "lanes size"]
Parameters = Float[np.ndarray, "lanes parameters"]
Flags = Bool[np.ndarray, " lanes"]

SCALE_STEPS = 24
SMALLEST_STEP = 1e-4


def natural_arch(rod: RodMechanics, p: Parameters) -> tuple[Lanes, Flags]:
    """State at q = 0 reached from the straight rod, per lane, and whether it was reached.

    First λ = 0 and ν free while (Θ, Δ) grow from 0 to their values; then ν moves to its value with
    (Θ, Δ) held. Lanes where the second part meets a fold, a loss of stability, or Θ ≤ 0 (no upright
    side) are not found.
    """
    start, nu, found = _scaled_up(rod, p)
    found &= p[:, 0] > 0.0
    z = np.full_like(start, np.nan)
    lanes = np.flatnonzero(found)
    z[lanes], reached = _moved(rod, start[lanes], p[lanes], nu[lanes])
    found[lanes] = reached
    return z, found


def _scaled_up(
    rod: RodMechanics, p: Parameters
) -> tuple[Lanes, Float[np.ndarray, " lanes"], Flags]:
    """Free-span states (λ = 0) at the end angles of p, with their spans."""
    lanes, size = len(p), rod.size
    column, row = np.zeros((lanes, 1, size)), np.zeros((lanes, 1, size))
    column[:, 0, -2], row[:, 0, -2] = -1.0, 1.0  # ∂F/∂ν, and the equation λ = 0
    border = (column, row, np.zeros((lanes, 1, 1)))
    s = rod.mesh.nodes[1:-1]
    # small angles: θ = Θ(1 − 2s) + Δ(1 − 6s + 6s²) has ∫θ = 0 and θ'' = 12Δ = 4π²μ
    unit = np.zeros((lanes, size + 1))
    unit[:, : rod.unknowns] = np.outer(p[:, 0], 1 - 2 * s) + np.outer(p[:, 1], 1 - 6 * s + 6 * s**2)
    unit[:, -2] = 3.0 * p[:, 1] / np.pi**2
    x, before, found = np.zeros_like(unit), np.zeros_like(unit), np.ones(lanes, bool)
    x[:, -1] = before[:, -1] = 1.0
    at = p.copy()
    at[:, 2] = 0.0
    for step in range(1, SCALE_STEPS + 1):
        at[:, :2] = p[:, :2] * step / SCALE_STEPS
        guess = 2.0 * x - before if step > 1 else x + unit / SCALE_STEPS
        before, x = x, guess
        for _ in range(8):
            at[:, 3] = x[:, -1]
            defect = np.concatenate([rod.residual(x[:, :-1], at), x[:, -3:-2]], axis=1)
            change = rod.solve(x[:, :-1], at, -defect[:, None], border).x[:, 0]
            x = x + change
            if np.abs(change).max() < 1e-12:
                break
        found &= np.isfinite(x).all(axis=1) & (np.abs(change).max(axis=1) < 1e-8)
        x[~found] = 0.0
    return np.ascontiguousarray(x[:, :-1]), x[:, -1], found


def _moved(
    rod: RodMechanics, z: Lanes, p: Parameters, nu: Float[np.ndarray, " lanes"]
) -> tuple[Lanes, Flags]:
    """Move the span from `nu` to its value in p: steps halved until they follow one branch."""
    lanes = len(z)
    velocity = np.zeros_like(p)
    velocity[:, 3] = p[:, 3] - nu
    t, step = np.zeros(lanes), np.full(lanes, 0.1)
    tangent = np.zeros_like(z)
    for _ in range(400):
        active = np.flatnonzero((t < 1.0) & (step > SMALLEST_STEP))
        if len(active) == 0:
            break
        target = np.minimum(t[active] + step[active], 1.0)
        tangent = _newton(rod, z[active], p[active], velocity[active], t[active], 1)[1]
        guess = z[active] + tangent * (target - t[active])[:, None]
        end, _, good = _newton(rod, guess, p[active], velocity[active], target, 7)
        moved = np.abs(end - z[active]).max(axis=1)
        good &= np.abs(end - guess).max(axis=1) <= 0.25 * moved + 1e-9
        taken = active[good]
        z[taken], t[taken] = end[good], target[good]
        step[active] *= np.where(good, 1.5, 0.5)
    return z, t >= 1.0


def _newton(
    rod: RodMechanics,
    z: Lanes,
    p: Parameters,
    velocity: Parameters,
    t: Float[np.ndarray, " lanes"],
    iterations: int,
) -> tuple[Lanes, Lanes, Flags]:
    """Newton at fixed parameters; state, tangent dz/dt, and whether it is a stable equilibrium."""
    at = p.copy()
    at[:, 2] = 0.0
    at[:, 3] += (t - 1.0) * velocity[:, 3]
    still, one, none = np.zeros_like(z), np.ones(len(z)), np.zeros(len(z))
    for _ in range(iterations):
        step = rod.advance(z, at, velocity, still, one, none)
        z = z + step.dz
    small = np.abs(step.dz).max(axis=1) < 1e-9
    return z, step.tangent_z, small & (step.index == 0)
