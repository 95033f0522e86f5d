"""Rows of quartic units in series, loaded in small steps: an independent few lines.

``E = Σ aᵢ(uᵢ(uᵢ − 2wᵢ))²/4 + cᵢuᵢ²/2 + k/2 (Σuᵢ − d)² − F Σuᵢ``. The Hessian is a diagonal matrix
plus k 11ᵀ: it is positive definite if all hᵢ > 0, or one is not and 1 + k Σ 1/hᵢ < 0.
"""

from itertools import product

import numpy as np
from numba import njit

from equimorph import EnergyStructure, Parameter, Unknown, word_graph
from equimorph.structures import States

STEPS, FINEST = 200, 2e-5
"""Steps of a stroke; size of a step at which the structure is taken to snap."""
FLOW, STILL, FAR = 0.03, 1e-8, 0.3
"""Step of the gradient flow, its last speed, and a change in one step that is another state's."""


def structure(n):
    """Rows of n units, all data as parameters."""
    parts = [f"a{i}*(u{i}*(u{i} - 2*w{i}))**2/4 + c{i}*u{i}**2/2" for i in range(n)]
    total = " + ".join(f"u{i}" for i in range(n))
    given = (("a", 1.0), ("w", 1.0), ("c", 0.0))
    data = [Parameter(f"{x}{i}", "1", 1.0, "fixed", v) for x, v in given for i in range(n)]
    return EnergyStructure(
        f"{' + '.join(parts)} + k/2*(total - d)**2 - F*total",
        [Unknown(f"u{i}", 0.0, (-3.0, 3.0)) for i in range(n)],
        [Parameter("F", "1", 1.0, "load"), Parameter("d", "1", 1.0, "actuator", 0.0),
         Parameter("k", "1", 1.0, "fixed", 0.0), *data],
        definitions={"total": total},
    )  # fmt: skip


def draw(n, rng):
    """Random data (rows a, w, c), machine k, and strokes of F and d."""
    a, w = rng.uniform(0.6, 1.6, n), rng.uniform(0.7, 1.3, n)
    c = rng.uniform(-0.1, 0.1, n) * a * w**2
    k = rng.choice([0.0, 1.0]) * rng.uniform(0.05, 0.3) * (a * w**2).min()
    strokes = {"F": (-rng.uniform(0.2, 0.7), rng.uniform(0.2, 0.7))}
    if k > 0.0:
        strokes["d"] = (-rng.uniform(1.0, 9.0), rng.uniform(1.0, 9.0))
    return np.array([a, w, c]), k, strokes


def at_rest(row, data, k):
    """Stable states without load and stroke, found in every combination of wells."""
    found = []
    for word in product((0, 1), repeat=data.shape[1]):
        u, good = _newton(2.0 * data[1] * np.array(word), data, np.array([0.0, 0.0, k]))
        if good and word_of(u, data) == "".join(map(str, word)):
            found.append(u)
    p = np.tile(np.concatenate([[0.0, 0.0, k], data.ravel()]), (len(found), 1))
    return States(row, np.array(found), p)


def word_of(u, data):
    """Letters by the middles between the wells."""
    return "".join("01"[int(flag)] for flag in u >= data[1])


@njit
def _newton(u, data, load):
    """Stable equilibrium near a guess, and whether there is one."""
    a, w, c = data
    force, d, k = load
    u = u.copy()
    for _ in range(30):
        v = u - w
        slope = a * v * (v**2 - w**2) + c * u + k * (u.sum() - d) - force
        h = a * (3.0 * v**2 - w**2) + c
        x = -slope / h
        y = 1.0 / h
        step = x - y * (k * x.sum() / (1.0 + k * y.sum()))
        u += step
        if np.abs(step).max() < 1e-12:
            below = (h <= 0.0).sum()
            return u, below == 0 or (below == 1 and 1.0 + k * y.sum() < 0.0)
    return u, False


@njit
def _flow(u, data, load):
    """Gradient flow until it rests, by scalars: arrays would take ten times as long."""
    a, w, c = data
    force, d, k = load
    u = u.copy()
    for _ in range(1_000_000):
        pull, fastest = force - k * (u.sum() - d), 0.0
        for i in range(len(u)):
            v = u[i] - w[i]
            slope = a[i] * v * (v * v - w[i] * w[i]) + c[i] * u[i] - pull
            u[i] -= FLOW * slope
            fastest = max(fastest, abs(slope))
        if fastest < STILL:
            break
    return u


@njit
def ramp(u, data, load, which, end):
    """Move F (0) or d (1) towards an end: the state and the load after the first snap, if any."""
    load = load.copy()
    longest = abs(end - load[which]) / STEPS
    step = longest
    while load[which] != end:
        there = load.copy()
        near = abs(end - load[which]) <= step
        there[which] = end if near else load[which] + step * np.sign(end - load[which])
        new, good = _newton(u, data, there)
        if good and np.abs(new - u).max() < FAR:
            u, load, step = new, there, min(2.0 * step, longest)
            continue
        step = min(step, abs(end - load[which]))
        if step > FINEST:
            step *= 0.5
            continue
        u, good = _newton(_flow(u, data, there), data, there)
        return u, there, True
    return u, load, False


def closures(states, data, k, strokes):
    """By word: the words at rest that single strokes, turned back anywhere, lead to."""
    rest = np.array([0.0, 0.0, k])
    first = [_stop(u, rest, -1) for u in states.z]
    todo, leads, word = list(zip(first, states.z, strict=True)), {}, {}
    while todo:
        stop, u = todo.pop()
        if stop in leads:
            continue
        leads[stop], (line, *_, force, d) = [], stop
        word[stop] = word_of(u, data) if line < 0 else None
        for which, ends in enumerate(strokes.values()):
            if line in (-1, which):
                for end in (*ends, *([0.0] if line == which else [])):
                    new, there, snapped = ramp(u, data, np.array([force, d, k]), which, end)
                    if snapped or end == 0.0:
                        goal = _stop(new, there, which if snapped else -1)
                        leads[stop].append(goal)
                        todo.append((goal, new))
    return {word[stop]: {word[each] for each in _closure(stop, leads)} - {None} for stop in first}


def _stop(u, load, line):
    return (line, *np.round(u, 3).tolist(), *np.round(load[:2], 3).tolist())


def _closure(stop, leads):
    seen, todo = set(), [stop]
    while todo:
        here = todo.pop()
        if here not in seen:
            seen.add(here)
            todo += leads[here]
    return seen


def compare(row, n, rng):
    """Closures of a random row by `word_graph`, what it leaves open, and those by small steps."""
    data, k, strokes = draw(n, rng)
    rest = at_rest(row, data, k)
    letters = [row.descriptor(f"u{i}") >= data[1][i] for i in range(n)]
    graph = word_graph(rest, strokes, letters)
    ours, undecided = {}, {}
    for word in graph.words[: graph.resting]:
        found = graph.reached(word)
        ours[word] = {each for each, status in found.items() if status == "reached"}
        undecided[word] = {each for each, status in found.items() if status == "not found"}
    return ours, undecided, closures(rest, data, k, strokes)
