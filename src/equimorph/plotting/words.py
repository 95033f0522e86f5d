"""Figure of the words of a multistable structure, and the strokes between them."""

from collections import defaultdict

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from equimorph.argument_checks import check_arguments
from equimorph.plotting import style
from equimorph.tasks.words.word_graph import WordGraph

_HEIGHT, _ROOM = 2.5, (0.1, 0.62, 0.1, 0.1)
"""Inches, and inches around the axes: left, bottom, right, top."""
_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7")
_BEND = 0.16
"""Of arrows, so that there and back, and two strokes, do not coincide."""
_LETTERS = 7.0
"""Size in points."""
_MOST_NAMED = 64
"""Words up to which they are written out."""


@check_arguments
def words(graph: WordGraph, ax: Axes | None = None) -> Axes:
    """Words of the stable states at rest, by the number of letters 1, and strokes between them.

    An arrow is a stroke of one parameter from one state at rest to the next one, with all its snaps
    on the way; dashed where a snap may lead elsewhere, too.

    Parameters
    ----------
    graph
        Made by `word_graph` or `word_graph_over`.
    ax
        Where to draw; None makes a figure one column wide.

    Returns
    -------
    The axes.
    """
    with style.house_style():
        ax = ax or style.new_axes(style.SINGLE_COLUMN, _HEIGHT, _ROOM)
        places = _places(graph.words[: graph.resting])
        strokes = dict.fromkeys(each.stroke for each in graph.moves if each.kind != "free")
        lines = {stroke: _COLOURS[k % len(_COLOURS)] for k, stroke in enumerate(strokes)}
        bends = {stroke: _BEND * (k + 1) for k, stroke in enumerate(strokes)}
        for start, goal, stroke, certain in sorted(_leaps(graph)):
            ax.annotate(
                "", places[goal], places[start],
                arrowprops={
                    "arrowstyle": "-|>", "color": lines[stroke], "linewidth": 0.9,
                    "shrinkA": 9.0, "shrinkB": 9.0, "mutation_scale": 7.0,
                    "linestyle": "solid" if certain else (0, (3.0, 2.0)),
                    "connectionstyle": f"arc3,rad={bends[stroke]}",
                },
            )  # fmt: skip
        for word, place in zip(graph.words[: graph.resting], places, strict=True):
            text = word if graph.resting <= _MOST_NAMED else "·"
            ax.text(*place, text, ha="center", va="center", fontsize=_LETTERS, family="monospace")
        x, y = np.array(places).T
        ax.set(xlim=(x.min() - 0.5, x.max() + 0.5), ylim=(y.min() - 0.7, y.max() + 0.7))
        ax.set_yticks([])
        ax.spines[["left", "right", "top"]].set_visible(False)
        ax.set_xticks(np.unique(x))
        ax.set_xlabel("units in state 1")
        handles = [Line2D([], [], color=c, label=name or "together") for name, c in lines.items()]
        style.legend_below(ax, handles, room=True, columns=4)
    return ax


def _places(words: tuple[str, ...]) -> list[tuple[float, float]]:
    """Columns by the number of ones, rows in order, around the middle."""
    columns: dict[int, list[int]] = defaultdict(list)
    for number in sorted(range(len(words)), key=lambda k: words[k]):
        columns[words[number].count("1")].append(number)
    found = [(0.0, 0.0)] * len(words)
    for ones, own in columns.items():
        for row, number in enumerate(own):
            found[number] = float(ones), 0.5 * (len(own) - 1) - row
    return found


def _leaps(graph: WordGraph) -> set[tuple[int, int, str, bool]]:
    """From one state at rest to another, by a snap and the way back; by more if there is none."""
    after, leaps = defaultdict(list), set()
    for move in graph.moves:
        after[move.start].append(move)
    for first in range(graph.resting):
        todo, seen = [(first, "", True)], set()
        while todo:
            here, stroke, certain = todo.pop()
            if here < graph.resting and here != first:
                leaps.add((first, here, stroke, certain))
                continue
            home = [each for each in after[here] if each.kind == "free"]
            for move in after[here] if here == first else home or after[here]:
                further = (move.goal, move.stroke, certain and move.kind != "possible snap")
                if further not in seen:
                    seen.add(further)
                    todo.append(further)
    return leaps
