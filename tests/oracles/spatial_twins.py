"""What the kernels of rods in space compute, in plain numpy: derivatives by jets, and fields."""

import numpy as np
from numpy.polynomial import legendre

from equimorph.structures.spatial.quaternions import RIGHT, bilinear, matrices, normalise

STATIONS = 400


def equations(mechanics, z, p, *directions):
    """F with its derivatives along none, one or two directions."""
    given, y = mechanics.jets(z, p, *directions)
    unit, inverse, square = normalise(given)
    slope = mechanics.slope(unit, y)
    along = bilinear(lambda a, b: (a * b).sum(axis=-1), unit, slope)
    across = slope - bilinear(lambda a, b: a[..., None] * b, along, unit)
    out = bilinear(lambda a, b: a[..., None] * b, inverse, across)
    excess = square.copy()
    excess[0] -= 1.0
    inner = mechanics.model.unknown_nodes
    length = bilinear(lambda a, b: a[..., None] * b, excess, given)[:, :, inner]
    out = out[:, :, inner] + 0.5 * mechanics.stiff_lengths[:, None] * length
    closing = mechanics.by_scalars(unit, y)[..., : mechanics.constraints]
    return np.concatenate([out.reshape(*out.shape[:2], mechanics.unknowns), closing], axis=-1)


def energy(mechanics, z, p):
    """L without the multipliers' part, and shortenings at the nodes of every element."""
    given, y = mechanics.jets(z, p)
    model, m = mechanics.model, mechanics.constraints
    q, _, square = normalise(given)
    strain = mechanics.element_strains(q)[2]
    pull = mechanics.section_forces(q, y)[1]
    short = 1.0 - mechanics.stretches(pull, y)[0, ..., 0]
    bending = np.einsum("pls,seik->pleik", y, model.moment)
    density = 0.5 * ((mechanics.section_moments(strain, y) - bending) * strain).sum(axis=-1)
    density = density + pull[..., 0]
    pull[..., 0] += np.einsum("pls,sei->plei", y, model.tension)
    density = density - 0.5 * (model.softness * pull**2).sum(axis=-1)
    total = np.einsum("ei,lei->l", mechanics.weights, density[0])
    total = total + 0.5 * np.einsum("ls,st,lt->l", y[0], model.quadratic, y[0])
    total = total - (y[0][:, :m] * mechanics.by_scalars(q, y)[0][:, :m]).sum(axis=1)
    excess = square[0][:, model.unknown_nodes] - 1.0
    return total + 0.125 * (excess**2 @ mechanics.stiff_lengths), short.reshape(len(z), -1)


def nodal_fields(mechanics, z, p):
    """Places and strains at the nodes of every element: M' = r' × f from its left end."""
    model, mesh = mechanics.model, mechanics.mesh
    sums = mesh.reference.integral * mesh.lengths[:, None, None]
    q, y = mechanics.rotations(z, p)[None], mechanics.scalars(z, p)[None]
    turned, moved, strain = mechanics.element_strains(q)
    weights = mesh.element_weights[..., None]
    moment = 2.0 * weights * mechanics.section_moments(strain, y)[0]
    pull, axial = mechanics.section_forces(q, y)
    stretch = mechanics.stretches(axial, y)
    frames = matrices(q[0][:, mesh.element_nodes])
    slope = np.einsum("leick,leik->leic", frames, stretch[0])
    force = np.einsum("ls,seic->leic", y[0], model.force)
    first = np.einsum("ei,leik,leika->lea", mechanics.slopes[:, :, 0], moment, turned[0])
    first -= np.einsum("lek,kab,leb->lea", moment[:, :, 0], RIGHT, moved[0][:, :, 0])
    first += np.einsum("lek,leka->lea", (weights * stretch[0])[:, :, 0], pull[0][:, :, 0])
    left = -0.5 * np.einsum("lea,leka->lek", first, turned[0][:, :, 0])
    left = np.einsum("leck,lek->lec", frames[:, :, 0], left)
    inner = left[:, :, None] + np.einsum("eij,lejc->leic", sums, np.cross(slope, force))
    body = np.einsum("leick,leic->leik", frames, inner)
    stiff = np.repeat(model.stiffness[None], len(z), axis=0)
    stiff[..., 0] += np.einsum("ls,sei->lei", y[0], model.torsion)
    strains = (body + np.einsum("ls,seik->leik", y[0], model.moment)) / stiff
    inside = np.einsum("eij,lejc->leic", sums, slope)
    ends = np.cumsum(inside[:, :, -1], axis=1)
    start = np.where(model.from_start, 0.0, ends[:, -1])
    origin = np.einsum("cs,ls->lc", model.origin, y[0])
    before = (ends - inside[:, :, -1])[:, :, None]
    return inside + before + (origin - start)[:, None, None], strains


def largest_curvature(mechanics, z, p):
    """Largest √(κ_n² + κ_b²) among many stations of every element, and how far they are apart."""
    strains = nodal_fields(mechanics, z, p)[1][..., 1:]
    t = np.linspace(-1.0, 1.0, STATIONS)
    table = legendre.legvander(t, mechanics.mesh.degree) @ mechanics.mesh.reference.to_legendre
    bends = np.sqrt((np.einsum("ti,leik->letk", table, strains) ** 2).sum(axis=-1))
    return bends.max(axis=(1, 2)), np.abs(np.diff(bends, axis=2)).max(axis=(1, 2))
