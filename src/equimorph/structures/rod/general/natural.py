"""Natural states of general rods: continued from the stress-free shape."""

import numpy as np
from jaxtyping import Bool, Float
from numpy.polynomial import legendre

from equimorph.arrays import Lanes, Parameters, Values
from equimorph.structures.rod.continuation import Part, follow, newton
from equimorph.structures.rod.discretisation import reference_element
from equimorph.structures.rod.general.mechanics import GeneralMechanics
from equimorph.structures.rod.general.model import RodModel
from equimorph.structures.rod.natural import Natural, Outcome


def natural_rod(rod: GeneralMechanics, p: Parameters) -> Natural:
    """Unloaded states continued from the stress-free shape, per lane.

    `rod` is in the parameters of `model.raw_names`. The stress-free rod lies with its chord along
    the line between the supports, or as its only clamped end says. Its ends are then moved to
    where they belong: with held spans first with λ = 0 and the span free, then the span. A straight
    rod between pins that are nearer than its length has no natural state: it may buckle either
    way.
    """
    names = rod.model.names
    start, z = _stress_free(rod, p)
    span = names.index("nu") if "nu" in names else None
    out = Natural(z.copy(), np.zeros(len(p), int), np.ones(len(p)), np.ones(len(p)))
    here = np.arange(len(p))
    x = np.concatenate([z, start[:, [span or 0]]], axis=1)
    if span is not None and rod.model.quadratic[0, 0] == 0.0:
        still = np.zeros(len(p), bool)
        turn = Part(start, p, free=True, sharpening=still, span=span, multiplier=rod.unknowns)
        out.scale[:], x = follow(rod, turn, x)
        out.span[:] = x[:, -1]
        reached = out.scale >= 1.0
        out.outcome[~reached] = Outcome.FREE_FOLD
        here, x, start = here[reached], x[reached], p[reached]
        start[:, span] = x[:, -1]
    sharpening = rod.resolved(x[:, :-1], start)
    last = Part(start, p[here], free=False, sharpening=sharpening, span=span or 0)
    share, x = follow(rod, last, x)
    out.span[here] = x[:, -1]
    out.outcome[here[share < 1.0]] = Outcome.SPAN_FOLD
    there = np.flatnonzero(share >= 1.0)
    exact = newton(rod, last, there, np.ones(len(there)), x[there])[0].x[:, :-1]
    out.z[:] = np.nan
    out.z[here[there]] = exact
    return out


def _stress_free(rod: GeneralMechanics, p: Parameters) -> tuple[Parameters, Lanes]:
    """Stress-free shape: the places of its ends as parameters, and its state."""
    model, lanes, start = rod.model, len(p), p.copy()
    fine = reference_element(model.fine.along.shape[2] - 1)
    start[:, _forces(rod)] = 0.0
    y = np.concatenate([np.zeros((lanes, rod.constraints)), start, np.ones((lanes, 1))], axis=1)
    kappa = np.einsum("lj,jei->lei", y, model.fine.bending) / model.fine.rigidity
    lengths = model.mesh.lengths[:, None]
    theta = lengths * np.einsum("ij,lej->lei", fine.integral, kappa)
    before = np.cumsum(theta[:, :, -1], axis=1) - theta[:, :, -1]
    theta += before[:, :, None]
    weights = lengths * fine.weights
    chord = np.stack([(weights * f(theta)).sum(axis=(1, 2)) for f in (np.cos, np.sin)], axis=1)
    turn = _orientation(model, p, theta[:, -1, -1], chord)
    theta += turn[:, None, None]
    basis = legendre.legvander(2.0 * model.mesh.reference.nodes - 1.0, fine.degree)
    local = np.einsum("ki,lei->lek", basis @ fine.to_legendre, theta)
    nodal = np.concatenate([local[:, :, :-1].reshape(lanes, -1), local[:, -1:, -1]], axis=1)
    z = np.zeros((lanes, rod.size))
    z[:, : rod.unknowns] = nodal[:, rod.unknown_nodes]
    places = {
        "theta_A": theta[:, 0, 0],
        "theta_B": theta[:, -1, -1],
        "nu": (weights * np.cos(theta)).sum(axis=(1, 2)),
        "rise": (weights * np.sin(theta)).sum(axis=(1, 2)),
    }
    if "offset" in model.names:
        across = model.nodal.along[0, 0, 0], model.nodal.across[0, 0, 0]
        places["offset"] = across[0] * places["nu"] + across[1] * places["rise"]
    for i, name in enumerate(model.names):
        start[:, i] = places.get(name, start[:, i])
    return start, z


def _forces(rod: GeneralMechanics) -> Bool[np.ndarray, " parameters"]:
    """Which parameters are forces or couples, that a stress-free rod lacks."""
    model = rod.model
    couples = model.slope.copy()
    for e, nodes in enumerate(model.mesh.element_nodes):
        couples[:, nodes] -= model.element_slope[:, e]
    some = np.concatenate([model.sine, model.cosine, model.tension, couples], axis=1)
    large = np.abs(some).max(axis=1) > 1e-12 * max(np.abs(some).max(), 1.0)
    large |= model.pressure != 0.0
    return np.asarray(large[model.multipliers : -1])


def _orientation(
    model: RodModel, p: Parameters, turning: Values, chord: Float[np.ndarray, "lanes 2"]
) -> Values:
    """Angle of the stress-free shape at end A; `chord` and `turning` are those from angle 0."""
    value = dict(zip(model.names, p.T, strict=True))
    if "theta_A" in value and "theta_B" not in value:
        return np.asarray(value["theta_A"])
    if "theta_B" in value and "theta_A" not in value:
        return np.asarray(value["theta_B"] - turning)
    length = np.maximum(np.hypot(*chord.T), 1e-12)
    if "nu" in value and "rise" in value:
        wanted = np.arctan2(value["rise"], value["nu"])
    elif "theta_A" in value:
        return np.asarray(0.5 * (value["theta_A"] + value["theta_B"] - turning))
    elif "offset" in value:  # sin(angle − slide) times the length
        slide = np.arctan2(-model.nodal.along[0, 0, 0], model.nodal.across[0, 0, 0])
        wanted = slide + np.arcsin(np.clip(value["offset"] / length, -1.0, 1.0))
    elif "nu" in value:
        wanted = np.arccos(np.clip(value["nu"] / length, -1.0, 1.0))
    else:
        wanted = np.arcsin(np.clip(value["rise"] / length, -1.0, 1.0))
    return np.asarray(wanted - np.arctan2(chord[:, 1], chord[:, 0]))
