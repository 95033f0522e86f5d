"""Frames of all kinds that chains of links stand for."""

import equimorph as em

LINE = {"A": (0, 0), "B": (0.5, 0), "C": (1, 0)}
TIP = {"P": {"C": (0, -1)}}


def member(first, last, **more):
    return em.Member((first, last), mass=1.0, **more)


FRAMES = {
    "cantilever": (
        em.Frame(LINE, [member("A", "B"), member("B", "C")], {"A": "fixed"}, TIP), {"P": 2.0},
    ),
    "members from end to start": (
        em.Frame(LINE, [member("B", "A"), member("C", "B")], {"A": "fixed"}, TIP), {"P": 2.0},
    ),
    "portal": (
        em.Frame(
            {"A": (0, 0), "B": (0, 1), "C": (1, 1), "D": (1, 0)},
            [member("A", "B"), member("B", "C"), member("D", "C")],
            {"A": "fixed", "D": "pinned"}, {"P": {"B": (1, 0)}, "q": {"B-C": (0, -1)}},
        ), {"P": 1.0, "q": 2.0},
    ),
    "arc that stretches": (
        em.Frame(
            {"A": (0, 0), "C": (1, 0)}, [member("A", "C", EA=500.0, curvature=-1.0)],
            {"A": "pinned", "C": "pinned"}, {"q": {"A-C": (0, -1)}},
        ), {"q": 3.0},
    ),
    "hinges, spring, actuators": (
        em.Frame(
            {"A": (0, 0), "B": (1, 0.2), "C": (2, 0)},
            [member("A", "B", EA=300.0, hinges=("A",)), member("B", "C", EA=300.0, hinges=("C",))],
            {"A": "pinned", "C": {"y": "held", "x": 20.0}}, {"P": {"B": (0, -1)}},
            {"a": {"length": {"A-B": 1.0}}, "k": {"curvature": {"B-C": 1.0}}},
        ), {"P": 1.0, "a": 0.02, "k": 0.1},
    ),
    "supports that turn and move": (
        em.Frame(
            {"A": (0, 0), "B": (1, 0), "C": (2, 0)}, [member("A", "B"), member("B", "C")],
            {"A": {"x": "held", "y": "held", "angle": 5.0}, "C": "y"}, {"P": {"B": (0, -1, 0.3)}},
            {"t": {"turn": {"A": 1.0}}, "m": {"move": {"C": (0, 1)}}},
        ), {"P": 1.0, "t": 0.2, "m": 0.1},
    ),
    "a joint of three": (
        em.Frame(
            {"A": (0, 0), "B": (1, 0), "C": (1, 1), "D": (2, -0.3)},
            [member("A", "B"), member("C", "B"), member("B", "D")],
            {"A": "fixed", "C": "pinned"}, {"P": {"D": (0, -1)}},
        ), {"P": 1.0},
    ),
    "a ring under pressure": (
        em.Frame(
            {"A": (0, -1), "B": (1, 0), "C": (0, 1), "D": (-1, 0)},
            [member("A", "B", curvature=1.0), member("C", "B", curvature=-1.0),
             member("C", "D", curvature=1.0), member("D", "A", curvature=1.0)],
            {"A": "pinned", "C": "x"},
            {"p": {"pressure": ["A", "B", "C", "D", "A"]}, "F": {"A": (0, 1), "C": (0, -1)}},
        ), {"p": 1.5, "F": 0.4},
    ),
    "pressure around a corner": (
        em.Frame(
            {"A": (0, 0), "B": (0, 1), "C": (1, 0)}, [member("A", "B"), member("C", "B")],
            {"A": "fixed", "C": "y"}, {"p": {"pressure": ["A", "B", "C"]}},
        ), {"p": 1.0},
    ),
}  # fmt: skip
"""Frame, and what it is lifted to."""
