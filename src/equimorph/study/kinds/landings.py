"""Snaps on a way, told."""

from html import escape

from equimorph.plotting.curves import snap_steps
from equimorph.study import html
from equimorph.tasks import Route


def snaps_in_words(route: Route) -> str:
    """Return how many snaps there are, and what energy they free; nothing without one."""
    if not route.snaps:
        return ""
    count = len(route.snaps)
    freed = html.number(sum(each.released for each in route.snaps))
    snaps = "1 snap that frees" if count == 1 else f"{count} snaps that free"
    return f"by {snaps} {freed} of energy"


def report_of_snaps(route: Route) -> list[str]:
    """Return a table of the snaps: where, from what to what, and the energy that is freed."""
    if not route.snaps:
        return []
    assert route.path is not None
    before = [route.path.states[int(step)] for step in snap_steps(route)]
    height, energy = before[0].structure.elevation, before[0].structure.descriptor("energy")
    moved = [
        each.name
        for each, lowest, highest in zip(
            before[0].structure.parameters, *_range(route), strict=True
        )
        if highest > lowest
    ]
    rows = [
        [
            str(number),
            *(html.number(state[name], 6) for name in moved),
            html.number(float(height(state)), 5),
            html.number(float(height(snap.state)), 5),
            html.number(snap.released, 5),
        ]
        for number, (state, snap) in enumerate(zip(before, route.snaps, strict=True), 1)
    ]
    named = f"{height.name} ({height.unit})"
    head = ["snap", *moved, f"{named} before", f"{named} after", f"{energy.name} freed"]
    return [html.table([escape(each) for each in head], rows)]


def _range(route: Route) -> tuple[list[float], list[float]]:
    assert route.path is not None
    p = route.path.states.p
    return p.min(axis=0).tolist(), p.max(axis=0).tolist()
