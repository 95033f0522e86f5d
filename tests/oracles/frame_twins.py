"""What kernels of frames in space compute, in plain numpy: derivatives by jets, and moments."""

import numpy as np

from equimorph.structures.spatial.quaternions import RIGHT, bilinear, dot, matrices, normalise


def _scale(a, b):
    return a[..., None] * b


def equations(mechanics, z, p, *directions):
    """F with its derivatives along none, one or two directions."""
    model = mechanics.model
    q, w, angles, y = mechanics.jets(z, p, *directions)
    unit, inverse, square = normalise(q)
    slope = mechanics.slope(w, y)
    by_angle = mechanics.lean_on_parents(slope, w, angles)
    own = slope[:, :, model.free]
    across = own - bilinear(_scale, bilinear(dot, unit, own), unit)
    excess = square.copy()
    excess[0] -= 1.0
    out = bilinear(_scale, inverse, across)
    out = out + 0.5 * model.stiff_lengths[:, None] * bilinear(_scale, excess, q)
    closing = mechanics.by_scalars(w, y)[..., : mechanics.constraints]
    flat = out.reshape(*out.shape[:2], 4 * len(model.free))
    return np.concatenate([flat, by_angle, closing], axis=-1)


def moments(frame, z, p):
    """Moments (x, y, z) at the points, from the slopes at the ends and m' = f × r' between."""
    model = frame.model
    _, w, _, y = frame.jets(z, p)
    local, axes = frame.element_slopes(w, y)[0], w[0][:, model.nodes]
    turned = np.einsum("kab,leib->leika", RIGHT, axes)
    gradient = 0.5 * np.einsum("leika,leia->leik", turned, local)
    world = np.einsum("leiab,leib->leia", matrices(axes), gradient)
    chord = frame.chords(w, y)[0] / model.weights[..., None]
    turning = np.cross(frame.forces(y)[0], chord)
    sums = model.mesh.reference.integral * model.element_lengths[:, None, None]
    change = np.einsum("eij,leja->leia", sums, turning)
    gap = world[:, :, -1] + world[:, :, 0] - change[:, :, -1]
    share = model.mesh.reference.nodes[:, None]
    return change - world[:, :, :1] + gap[:, :, None] * share
