"""Rods of all kinds that a chain of links stands for."""

import equimorph as em

RODS = {
    "cantilever": (
        em.Rod(ends=("clamped", "free"), loads={"P": em.PointForce(1.0)}), {}, {"P": 0.1},
    ),
    "free end A": (
        em.Rod(ends=("free", "clamped"), loads={"P": em.PointForce(0.0)}), {}, {"P": 0.1},
    ),
    "pinned": (
        em.Rod("uniform", ends=("pinned", "pinned"), span=0.9, curvature=-2.0), {}, {"q": 0.3},
    ),
    "one end pinned": (
        em.Rod("uniform", ends=("pinned", "clamped"), span=0.9, curvature=-1.5), {}, {"q": 0.3},
    ),
    "guided": (em.Rod("uniform", ends=("clamped", "sliding")), {"Theta": 0.3}, {"q": 0.3}),
    "springs": (
        em.Rod(
            ends=(em.End(angle=0.2, y=3.0), em.End(angle=0.1, x=2.0)), span=0.9, curvature=-1.0,
            loads={"q": em.LineLoad()},
        ), {}, {"q": 0.2},
    ),
    "stiffness with a jump": (
        em.Rod(
            [[0, 1], [0.4, 2], [1, 0.5]], stiffness=[[0, 1], [0.3, 2], [0.3, 0.7], [1, 1]]
        ), {"Theta": 1.0}, {"q": 1.5},
    ),
    "curved": (
        em.Rod("left-half", curvature=[[0, -1], [0.5, -2], [0.5, 0], [1, 1]]),
        {"Theta": 0.9, "Delta": 0.2}, {"q": 0.8},
    ),
    "couple and force": (
        em.Rod(loads={"M": em.Couple(0.375), "F": em.PointForce(0.625, (1, -1))}),
        {"Theta": 1.0}, {"M": 0.05, "F": 0.3},
    ),
    "stretchable": (em.Rod("uniform", axial=30.0, span=0.9), {"Theta": 1.0}, {"q": 1.0}),
    "tendon": (
        em.Rod(
            ends=("clamped", "free"), axial=20.0,
            actuators={"T": em.Tendon([[0, 0.05], [1, 0.02]], 0.0, 0.75)},
        ), {}, {"T": 1.0},
    ),
    "segment that bends": (
        em.Rod("uniform", actuators={"k": em.Curvature(1.0, 0.2, 0.7)}),
        {"Theta": 1.0}, {"q": 1.0, "k": -1.0},
    ),
    "pressure": (em.Rod(loads={"p": em.Pressure()}), {"Theta": 1.0}, {"p": 0.5}),
    "pressure, guided": (
        em.Rod(ends=("clamped", "sliding"), loads={"p": em.Pressure()}), {"Theta": 0.5}, {"p": 0.3},
    ),
    "rolls along a slope": (
        em.Rod(
            "uniform", ends=("clamped", em.End("free", slide=0.5)), span=0.8, rise=0.1,
            curvature=-1.0,
        ), {}, {"q": 0.3},
    ),
    "units": (
        em.Rod("uniform", EI=2e-3, length=0.5, mass=0.2), {"Theta": 1.0}, {"q": 1.58},
    ),
}  # fmt: skip
"""Rod, actuators of its natural state, and what it is lifted to."""


def loaded(name: str) -> em.structures.State:
    """The state of one of them."""
    rod, actuators, to = RODS[name]
    return em.lift(rod.natural_state(**actuators), to).end.state
