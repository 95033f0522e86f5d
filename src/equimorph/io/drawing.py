"""What readers of drawings give."""

from collections import Counter
from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from equimorph.array_types import Float, Int

Polyline = Float[np.ndarray, "points 3"]


@dataclass(frozen=True)
class Drawing:
    """Polylines of a file.

    Parameters
    ----------
    polylines
        Points of each, two or more.
    unit
        Of length, if the file states one.
    content
        What the file has where it has no lines, for messages.
    """

    polylines: list[Polyline]
    unit: str = ""
    content: str = ""


def edges_of_faces(
    points: Float[np.ndarray, "vertices 3"], faces: Iterable[Int[np.ndarray, " corners"]]
) -> list[Polyline]:
    """Edges of faces, each face as a closed polyline."""
    return [points[np.append(face, face[0])] for face in faces]


def count_words(words: Iterable[str]) -> str:
    """How often each word occurs: "3 ARC, 1 TEXT"."""
    return ", ".join(f"{count} {word}" for word, count in Counter(words).items())
