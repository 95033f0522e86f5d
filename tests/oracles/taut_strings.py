"""Shortest ways between two points around discs of a plane: the taut strings of all classes."""

from itertools import product

import numpy as np

Disc = tuple[np.ndarray, float]


def taut_strings(first, last, discs: list[Disc], longest: float) -> list[float]:
    """Lengths up to `longest` of all locally shortest ways, in order: straight lines and arcs.

    Each is the shortest one of its homotopy class. Ways turn around each disc in turn by up to two
    turns, counterclockwise (+) or clockwise (−).
    """
    turning = [(*disc, sign) for disc, sign in product(discs, (1, -1))]
    goal = (np.asarray(last), 0.0, 1)
    found, open_ = list[float](), [(0.0, (np.asarray(first), 0.0, 1), np.asarray(first))]
    while open_:
        length, here, at = open_.pop()
        for there in (*turning, goal):
            line = None if here[0] is there[0] else _tangent(here, there)
            if line is None or not _is_free(*line, discs, (here, there)):
                continue
            straight = np.linalg.norm(line[1] - line[0])
            for arc in _arcs(here, at, line[0], discs):
                whole = length + here[1] * arc + straight
                if whole <= longest and there is goal:
                    found.append(whole)
                elif whole <= longest:
                    open_.append((whole, there, line[1]))
    return sorted(found)


def _tangent(here, there):
    """Where the common tangent leaves a disc and meets the next, with both on their sides."""
    between = there[0] - here[0]
    sine = (there[1] * there[2] - here[1] * here[2]) / np.linalg.norm(between)
    if abs(sine) >= 1.0:
        return None
    angle = np.arctan2(between[1], between[0]) - np.arcsin(sine)
    left = np.array([-np.sin(angle), np.cos(angle)])
    return tuple(middle - radius * sign * left for middle, radius, sign in (here, there))


def _is_free(start, end, discs, touched) -> bool:
    """Whether a segment meets no disc but those that it touches."""
    way = end - start
    for middle, radius in discs:
        share = np.clip((middle - start) @ way / (way @ way), 0.0, 1.0)
        slack = 1e-9 if any(middle is each[0] for each in touched) else 0.0
        if np.linalg.norm(start + share * way - middle) < radius - slack:
            return False
    return True


def _arcs(disc, start, end, discs):
    """Angles by which a way may turn around a disc without meeting another one."""
    middle, radius, sign = disc
    if radius == 0.0:
        return [0.0]
    begin, stop = (np.arctan2(*(place - middle)[::-1]) for place in (start, end))
    turn = (stop - begin) * sign % (2.0 * np.pi)

    def meets(angle):
        at = begin + sign * np.linspace(0.0, angle, 200)
        way = middle + radius * np.stack([np.cos(at), np.sin(at)], axis=1)
        others = [each for each in discs if each[0] is not middle]
        return any((np.linalg.norm(way - m, axis=1) < r).any() for m, r in others)

    return [angle for angle in (turn, turn + 2.0 * np.pi) if not meets(angle)]
