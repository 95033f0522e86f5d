"""F of general rods and its first derivatives over boxes, by interval arithmetic."""

import numpy as np

from equimorph.array_types import Float
from equimorph.linalg.intervals import Interval, cosine, join, product, sine, square, symmetric
from equimorph.structures.equations import Enclosed
from equimorph.structures.rod.model import RodModel


def enclose_rod(
    model: RodModel,
    stiffness: Float[np.ndarray, "nodes nodes"],
    unknown: slice,
    z: Interval,
    p: Interval,
) -> Enclosed:
    """Bounds for a `RodModel` without pressure; `stiffness` is assembled.

    Gradient and Hessian of L by the angles of all nodes and the scalars y; then by the chain rule
    those by (z, p), as prescribed ends are ``turned y``.
    """
    lanes, nodes = z.shape[0], len(stiffness)
    count = z.shape[1] - model.multipliers
    y = join([z[:, count:], p, Interval.at(np.ones((lanes, 1)))], 1)
    theta = Interval.zeros(lanes, nodes)
    ends = product(model.turned, y[..., None])[..., 0]
    theta[:, [0, -1]], theta[:, unknown] = ends, z[:, :count]
    gradient, hessian = _by_angles_and_scalars(model, theta, y)
    bent = product(stiffness, theta[..., None])[..., 0]
    gradient[:, :nodes] = gradient[:, :nodes] + bent
    hessian[:, :nodes, :nodes] = hessian[:, :nodes, :nodes] + stiffness
    change = np.zeros((z.shape[1] + p.shape[1], nodes + model.scalars))
    change[count:, [0, nodes - 1]] = model.turned[:, :-1].T
    change[count:, nodes:-1] = np.eye(model.scalars - 1)
    angles = np.arange(nodes)[unknown]
    change[:, angles], change[range(count), angles] = 0.0, 1.0
    full = symmetric(product(change, product(change, hessian).transpose(0, 2, 1)))
    rows = full[:, : z.shape[1]]
    residual = product(change[: z.shape[1]], gradient[..., None])[..., 0]
    return Enclosed(residual, rows[:, :, : z.shape[1]], rows[:, :, z.shape[1] :])


def _by_angles_and_scalars(
    model: RodModel, theta: Interval, y: Interval
) -> tuple[Interval, Interval]:
    """First and second derivatives of L without its bending energy, at all nodes and scalars.

    At a point a(y) sin θ + b(y) cos θ = N and N' = a cos θ − b sin θ; with t = 1 − γ (N + T) the
    derivatives of N − ½ γ (N + T)² are t N' by θ and t ∂N − γ (N + T) ∂T by y.
    """
    (lanes, nodes), points = theta.shape, model.mesh.element_nodes.ravel()
    tables, soft = (model.sine, model.cosine, model.tension), model.softness
    a, b, pull = (product(each.T, y[..., None])[..., 0] for each in tables)
    s, c = (function(theta[:, points]) for function in (sine, cosine))
    normal, shear = a * s + b * c, a * c - b * s
    stretch = 1.0 - soft * (normal + pull)
    straight = model.sine * s[:, None] + model.cosine * c[:, None] + model.tension
    turned = model.sine * c[:, None] - model.cosine * s[:, None]
    mixed = stretch[:, None] * turned - (soft * shear)[:, None] * straight
    twice = Interval.at(np.broadcast_to(model.quadratic, (lanes, *model.quadratic.shape)))
    if soft.any():
        weighted = soft * straight
        twice = twice - (straight[:, :, None] * weighted[:, None]).sum(3)
    sums = np.zeros((nodes, len(points)))
    sums[points, range(len(points))] = 1.0
    curved = -(stretch * normal) - soft * square(shear)
    force = product(sums, (stretch * shear)[..., None])[..., 0]
    force = force - product(model.slope.T, y[..., None])[..., 0]
    closing = (stretch[:, None] * straight - model.tension).sum(2)
    closing = closing - product(model.slope, theta[..., None])[..., 0]
    closing = closing + product(model.quadratic, y[..., None])[..., 0]
    cross = product(sums, mixed.transpose(0, 2, 1)) - model.slope.T
    hessian = Interval.zeros(lanes, nodes + len(model.slope), nodes + len(model.slope))
    hessian[:, range(nodes), range(nodes)] = product(sums, curved[..., None])[..., 0]
    hessian[:, :nodes, nodes:] = cross
    hessian[:, nodes:, :nodes] = cross.transpose(0, 2, 1)
    hessian[:, nodes:, nodes:] = twice
    return join([force, closing], 1), hessian
