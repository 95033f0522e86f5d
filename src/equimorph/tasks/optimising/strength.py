"""`strongest`: actuator settings with the largest limit load, nominal and robust."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from operator import itemgetter
from typing import Literal

import numpy as np

from equimorph.argument_checks import check_arguments
from equimorph.arrays import Flags, Float, Settings, Values
from equimorph.equilibria import LimitLoad
from equimorph.errors import InputError
from equimorph.tasks.maps.actuator_map import settings_of
from equimorph.tasks.maps.curves import MapCurve
from equimorph.tasks.maps.limit_load import LimitLoadMap
from equimorph.tasks.optimising.ridges import BESIDE, highest_point, settings_across
from equimorph.tasks.optimising.two_parameter_search import climb, maximise_least

CANDIDATES = 4
"""Local maxima over the vertices from which interior optima are searched."""
ROBUST = 2
"""Local maxima of the worst case over the vertices from which robust optima are searched."""
ACROSS = 1e-3
"""Radius, in its first one, at which searches for robust optima end before the exact one."""
FIRST = 64
"""Vertices with the largest values at which the worst case is determined first."""
EXCHANGES = 5
"""Rounds in which offsets are added at which the limit load is smallest."""
HOPELESS = 0.9
"""Curves, and starts, whose values stay below this share of what was found are left out."""
LEVEL = 1e-3
"""Slope along a curve at which its top is reached."""
ONE_OPTIMUM = 1e-4
"""Distance in scales below which two optima are one."""


@dataclass(frozen=True, eq=False)
class Strongest:
    """A setting with a locally largest limit load; at a cliff, with its least upper bound.

    Parameters
    ----------
    setting, value
        The setting and its limit load; on a ridge, the value on the ridge itself.
    kind
        "interior" where the map is smooth, else the kind of the map's curve on which it lies, with
        ", cliff" if its value is the limit from one side; or "edge": at a kink or jump whose cause
        is not known, or where the map ends; or "robust".
    slope
        Slope of the load along the curve, or largest slope of the map at an interior optimum: the
        residual of the optimality condition.
    sides
        On a curve: limit loads on both sides at `distances` across it.
    limit
        The limit load at the setting, with its path.
    """

    setting: Mapping[str, float]
    value: float
    kind: str
    slope: float
    distances: Values
    sides: Float[np.ndarray, "2 distances"]
    limit: LimitLoad

    def __repr__(self) -> str:
        """Value, setting and kind."""
        at = ", ".join(f"{name} = {value:.6g}" for name, value in self.setting.items())
        return f"Strongest({self.value:.8g} at {at}: {self.kind})"

    @property
    def one_sided(self) -> tuple[float, float]:
        """Limits of the limit load towards the optimum from both sides across its curve.

        Extrapolated from the three closest distances, which grow by equal factors, with the
        power of the distance that they follow: 2/3 at branch points.
        """
        far, middle, near = self.sides[:, -3:].T
        with np.errstate(divide="ignore", invalid="ignore"):
            share = (near - middle) / (middle - far)
            limits = near + np.nan_to_num((near - middle) * share / (1.0 - share))
        return float(limits[0]), float(limits[1])


@dataclass(frozen=True, eq=False)
class StrongestSettings:
    """Actuator settings with the largest limit load, nominal or robust.

    Parameters
    ----------
    status
        "found"; "refused" with the reason in `why`; or "not converged": the last round of a robust
        search found a lower load in the box than that which it had raised.
    all
        Local optima, the best first.
    offsets
        Imperfections that the answer allows for; empty for a nominal optimum.
    guaranteed
        For a robust optimum, the smallest limit load over the imperfections, which is maximised;
        otherwise the value of the best setting.
    price
        For a robust optimum, the loss against the best nominal setting without imperfections.
    at_risk
        For a robust optimum, the smallest limit load over the imperfections at the best nominal
        setting.
    nominal
        The best nominal setting.
    """

    status: Literal["found", "refused", "not converged"]
    why: str
    all: tuple[Strongest, ...]
    offsets: Mapping[str, float]
    guaranteed: float
    price: float
    at_risk: float
    nominal: Strongest | None = None

    def __repr__(self) -> str:
        """The best, and its guarantee."""
        if self.status == "refused":
            return f"StrongestSettings(refused: {self.why})"
        text = f"StrongestSettings({self.best}"
        return f"{text}; guaranteed {self.guaranteed:.6g})" if self.offsets else f"{text})"

    @property
    def best(self) -> Strongest:
        """The best one."""
        return self.all[0]

    @property
    def margin(self) -> float:
        """Guaranteed load minus the worst case of the best nominal setting."""
        return self.guaranteed - self.at_risk


@check_arguments
def strongest(
    lmap: LimitLoadMap, *, offsets: Mapping[str, float] | None = None
) -> StrongestSettings:
    """Find the actuator settings with the largest limit load.

    The vertices of the map that no neighbour beats, and the highest points of the curves on which
    it bends or jumps, are candidates. On ridges (branch points, exchanges) the load is made
    stationary along the curve of states with the tests that vanish there; elsewhere parabolas
    through rays are climbed.

    Parameters
    ----------
    lmap
        Map of limit loads; rays are its functions.
    offsets
        Largest errors of the settings, by name: the smallest limit load over their box is made as
        large as possible. The box is sampled at its centre, corners and middles of sides, and
        where it is smallest of 21 × 21 settings, until that changes nothing.

    Returns
    -------
    Local optima, the best first; with offsets the robust one, what it guarantees and its price.

    Raises
    ------
    InputError
        If offsets have other names or are not positive.

    Examples
    --------
    >>> import equimorph as em
    >>> arch = em.Rod()
    >>> grid = em.Grid(Theta=(0.8, 1.2, 4), Delta=(-0.2, 0.2, 6))
    >>> lmap = em.limit_load_map(arch, grid, "q", within=[arch.max_curvature <= 10])
    >>> best = em.strongest(lmap).best
    >>> round(best.value, 4), best.kind
    (4.265, 'branch point')
    """
    given = dict(offsets or {})
    for name, size in given.items():
        if name not in lmap.grid.names or not (np.isfinite(size) and size > 0.0):
            raise InputError(
                f"`offsets` must be positive numbers for {' or '.join(lmap.grid.names)}; "
                f"got {name}: {size!r}."
            )
    if not np.isfinite(lmap.value).any():
        why = "no setting of the map has a limit load"
        return StrongestSettings("refused", why, (), given, np.nan, np.nan, np.nan)
    sure = _sure(lmap)
    if not given:
        value = sure[0].value
        return StrongestSettings("found", "", tuple(sure), {}, value, 0.0, value, sure[0])
    return _robust(lmap, sure[0], given)


def _sure(lmap: LimitLoadMap) -> list[Strongest]:
    """Local optima without imperfections, the best first; none is below any known value."""
    found = _on_curves(lmap)
    vertices = _vertices(lmap, lmap.value)
    beside = _near_curves(lmap, vertices)
    for setting, value, near in zip(vertices, lmap.rays(vertices), beside, strict=True):
        # beside a curve a climb ends below its highest point, unless it leads elsewhere
        if near and value <= max((each.value for each in found), default=-np.inf) + LEVEL:
            continue
        top = climb(lmap.rays, setting, _steps(lmap), lmap.grid.box)
        sides = _sides(lmap, top.setting, _steps(lmap) / np.linalg.norm(_steps(lmap)))
        kind, slope = "interior" if top.smooth else "edge", float(np.abs(top.slope).max())
        found.append(_strongest(lmap, top.setting, top.value, kind, slope, sides))
    return _distinct(lmap, found)


def _on_curves(lmap: LimitLoadMap) -> list[Strongest]:
    """Highest points of the curves of a map, but for those that are far from the best."""
    found: list[Strongest] = []
    for curve in sorted(lmap.curves, key=lambda each: -_level(each)):
        if found and _level(curve) < HOPELESS * found[0].value:
            continue
        ridge = highest_point(lmap, curve)
        if ridge is None or not lmap.grid.box.holds(ridge.setting, slack=1e-9):
            continue
        if ridge.slope > LEVEL:  # the end of a curve
            continue
        sides = ridge.sides
        if sides is None:
            sides = _sides(lmap, ridge.setting, ridge.across)
        if np.isfinite(sides).any() and np.isfinite(ridge.value):
            kind = f"{curve.kind}, cliff" if ridge.cliff else curve.kind
            found.append(_strongest(lmap, ridge.setting, ridge.value, kind, ridge.slope, sides))
    return found


def _level(curve: MapCurve) -> float:
    """Largest known value at a curve."""
    return float(np.nan_to_num(curve.values[:, 1]).max(initial=0.0))


def _near_curves(lmap: LimitLoadMap, settings: Settings) -> Flags:
    """Settings closer than two grid steps to a curve on which the map is not smooth."""
    places = [curve.points for curve in lmap.curves]
    if not places:
        return np.zeros(len(settings), bool)
    gap = np.abs(settings[:, None] - np.concatenate(places)[None]) / _steps(lmap)
    return np.asarray((gap.max(axis=2) < 2.0).any(axis=1))


def _distinct(lmap: LimitLoadMap, found: list[Strongest]) -> list[Strongest]:
    """The best first; climbs that ended next to a ridge count as the ridge."""
    kept: list[Strongest] = []
    order = {"edge": 1}
    for each in sorted(found, key=lambda one: (order.get(one.kind, 0), -one.value)):
        place = np.array(list(each.setting.values()))
        close = [
            other
            for other in kept
            if np.abs(place - list(other.setting.values())).max()
            < (ONE_OPTIMUM if each.kind != "edge" else _steps(lmap).max())
        ]
        if not close:
            kept.append(each)
    return sorted(kept, key=lambda one: -one.value)


def _steps(lmap: LimitLoadMap) -> Float[np.ndarray, " 2"]:
    """Spacing of the grid."""
    box = lmap.grid.box
    return np.asarray((box.upper - box.lower) / np.array(lmap.grid.intervals))


def _vertices(lmap: LimitLoadMap, value: Float[np.ndarray, "rows columns"]) -> Settings:
    """Vertices of the grid that none of their eight neighbours beats, the best first."""
    padded = np.pad(np.where(np.isfinite(value), value, -np.inf), 1, constant_values=-np.inf)
    rows, columns = value.shape
    around = [
        padded[1 + i : 1 + i + rows, 1 + j : 1 + j + columns]
        for i, j in product((-1, 0, 1), repeat=2)
        if (i, j) != (0, 0)
    ]
    top = np.isfinite(value) & (np.where(np.isfinite(value), value, -np.inf) >= np.max(around, 0))
    i, j = np.nonzero(top)
    best = np.argsort(-value[i, j], kind="stable")[:CANDIDATES]
    axes = lmap.grid.axes()
    return np.stack([axes[0][i[best]], axes[1][j[best]]], axis=1)


def _sides(
    lmap: LimitLoadMap, setting: Float[np.ndarray, " 2"], across: Float[np.ndarray, " 2"]
) -> Float[np.ndarray, "2 distances"]:
    """Limit loads on both sides of a setting."""
    return lmap.rays(settings_across(setting, across)).reshape(2, -1)


def _strongest(
    lmap: LimitLoadMap,
    setting: Float[np.ndarray, " 2"],
    value: float,
    kind: str,
    slope: float,
    sides: Float[np.ndarray, "2 distances"],
) -> Strongest:
    box = lmap.grid.box
    place = np.clip(setting, box.lower, box.upper)
    at = dict(zip(lmap.grid.names, place.tolist(), strict=True))
    return Strongest(at, value, kind, slope, BESIDE, sides, lmap.at(**at))


def _robust(lmap: LimitLoadMap, sure: Strongest, offsets: Mapping[str, float]) -> StrongestSettings:
    """Setting whose worst case is best."""
    size = np.array([offsets.get(name, 0.0) for name in lmap.grid.names])
    around, everywhere = (
        np.unique(np.array(list(product(np.linspace(-1.0, 1.0, count), repeat=2))) * size, axis=0)
        for count in (3, 21)
    )
    for _ in range(EXCHANGES):
        setting, guaranteed = _raise_minimum(lmap, around)
        values = np.nan_to_num(lmap.rays(setting + everywhere), nan=0.0)
        lowest = int(values.argmin())
        if values[lowest] >= guaranteed - LEVEL:
            break
        # a jump passes through the box between the sampled settings
        around = np.concatenate([around, everywhere[[lowest]]])
    gap = guaranteed - values[lowest]
    why = f"the load in the box falls {gap:.3g} below that at its sampled settings"
    status: Literal["found", "not converged"] = "found" if gap <= LEVEL else "not converged"
    nominal, guaranteed = float(lmap.rays(setting[None])[0]), min(guaranteed, values[lowest])
    sides = _sides(lmap, setting, size / np.linalg.norm(size))
    found = _strongest(lmap, setting, nominal, "robust", np.nan, sides)
    best = np.array(list(sure.setting.values()))
    at_risk = float(np.nan_to_num(lmap.rays(best + everywhere), nan=0.0).min())
    price = sure.value - nominal
    told = status, "" if status == "found" else why
    worst = float(guaranteed)
    return StrongestSettings(*told, (found,), dict(offsets), worst, price, at_risk, sure)


def _raise_minimum(
    lmap: LimitLoadMap, around: Float[np.ndarray, "offsets 2"]
) -> tuple[Float[np.ndarray, " 2"], float]:
    """Setting whose smallest limit load at some offsets is largest, and that."""

    def pieces(settings: Settings) -> Float[np.ndarray, "lanes m"]:
        many = (settings[:, None] + around).reshape(-1, 2)
        values = np.nan_to_num(lmap.rays(many), nan=0.0)
        return np.asarray(values.reshape(len(settings), -1))

    def worst(settings: Settings) -> Values:
        return np.asarray(pieces(settings).min(axis=1))

    value = _worst_at_vertices(lmap, worst)
    radius, box = _steps(lmap), lmap.grid.box
    ends = [
        maximise_least(pieces, vertex, radius, box, ACROSS)
        for vertex in _vertices(lmap, value)[:ROBUST]
    ]
    hopeful = [
        place for place, least in ends if least >= HOPELESS * max(ends, key=itemgetter(1))[1]
    ]
    # across a jump the search goes on in all directions; what follows is the exact one
    tops = [climb(worst, place, 0.1 * radius, box, ACROSS) for place in hopeful]
    exact = [maximise_least(pieces, top.setting, 0.1 * radius, box) for top in tops]
    return max(exact, key=itemgetter(1))


def _worst_at_vertices(
    lmap: LimitLoadMap, worst: Callable[[Settings], Values]
) -> Float[np.ndarray, "rows columns"]:
    """Worst values at the vertices of the grid; not numbers where these cannot be near the best.

    No worst value is larger than that of the map itself.
    """
    settings, most = settings_of(lmap.grid)[0], np.nan_to_num(lmap.value.ravel())
    out = np.full(len(settings), np.nan)
    first = np.argsort(-most, kind="stable")[:FIRST]
    out[first] = worst(settings[first])
    rest = np.flatnonzero(np.isnan(out) & (most >= HOPELESS * out[first].max()))
    if len(rest):
        out[rest] = worst(settings[rest])
    return out.reshape(lmap.value.shape)
