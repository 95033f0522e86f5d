"""How far targets are missed between the rows of a schedule, where parameters move straight on."""

from collections.abc import Sequence

import numpy as np

from equimorph.arrays import Float, Int
from equimorph.equilibria import Leg, Path
from equimorph.manifold.lookup.exact_states import exact_states
from equimorph.model import Descriptor
from equimorph.structures import States


def misses_between(
    path: Path, legs: Sequence[Leg], descriptors: tuple[Descriptor, ...]
) -> dict[str, float]:
    """Largest misses half-way between successive states of a path, by the descriptors' names.

    There the parameters are the means of those of both states. Where no stable state is found from
    the mean of both, the miss is infinite.
    """
    states, at = path.states, path.at
    first, last = states[:-1], states[1:]
    p = 0.5 * (first.p + last.p)
    z, good, index = exact_states(states.structure, 0.5 * (first.z + last.z), p)
    here = States(states.structure, z, p)
    middle = 0.5 * (at[:-1] + at[1:])
    leg = np.minimum(middle.astype(int), len(legs) - 1)
    out = {}
    for each in descriptors:
        wanted = _targets(each, legs, leg, middle - leg, 0.5 * (each(first) + each(last)))
        gap = np.where(good & (index == 0), np.abs(each(here) - wanted), np.inf)
        out[each.name] = float(np.nan_to_num(gap, nan=0.0).max(initial=0.0))
    return out


def _targets(
    descriptor: Descriptor,
    legs: Sequence[Leg],
    leg: Int[np.ndarray, " rows"],
    share: Float[np.ndarray, " rows"],
    mean: Float[np.ndarray, " rows"],
) -> Float[np.ndarray, " rows"]:
    """Targets of a descriptor half-way between rows; NaN on legs that prescribe none of it.

    Rows meet their targets, so that on legs of constant rates these are the means of both rows.
    """
    out = np.full(len(leg), np.nan)
    for number, own in enumerate(legs):
        mine = leg == number
        if callable(own):
            values = [own(float(t)).get(descriptor, np.nan) for t in share[mine]]
            out[mine] = np.array(values, float)
        elif descriptor in own:
            out[mine] = mean[mine]
    return out
