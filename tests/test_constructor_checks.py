"""One wrong value, at any depth, in what structures and their parts are made of: it is refused."""

from collections.abc import Mapping
from typing import Any

import pytest

import equimorph as em
from argument_faults import mutants, outcome
from typecheck import unchecked

LEAST_CALLS = 3000
JOINTS = {"A": (-1.0, 0.0), "B": (0.0, 0.3), "C": (1.0, 0.0)}
IN_SPACE = {"A": (-1.0, 0.0, 0.0), "B": (0.0, 0.3, 0.2), "C": (1.0, 0.0, 0.0), "D": (0.0, 1.0, 1.0)}
UNITS = {"force": "N", "length": "mm"}
CLAMP_AND_PIN = ("clamped", {"angle": "free", "x": "held", "y": 2.0})
SYMBOL = {"name": "x", "natural": "1 + 0*p", "guesses": (-2.0, 2.0), "mass": 1.0, "unit": "1"}

RIGHT: tuple[tuple[Any, Mapping[str, Any]], ...] = (
    (em.Spring, {"stiffness": 2.0}),
    (em.Bar, {"ends": ("A", "B"), "EA": 1.0, "EI": 0.1, "rest": 1.0}),
    (em.Member, {"ends": ("A", "B"), "EI": 1.0, "EA": 900.0, "curvature": 0.1, "hinges": ["B"],
                 "weight": 1.0}),
    (em.Unknown, {**SYMBOL, "lower": -3.0, "upper": 3.0}),
    (em.Unknown, {**SYMBOL, "period": 6.3}),
    (em.Parameter, {"name": "p", "unit": "1", "scale": 1.0, "role": "load", "default": 0.5}),
    (em.End, {"angle": "free", "x": 2.0, "y": "held"}),
    (em.End, {"angle": "held", "slide": 0.5}),
    (em.Strip, {"width": 20.0, "thickness": 0.5, "E": 2e5, "nu": 0.3, "density": 7850.0}),
    (em.Tube, {"diameter": 10.0, "wall": 1.0, "E": 7e4, "nu": 0.3}),
    (em.Round, {"diameter": 2.0, "E": 7e4, "nu": 0.3}),
    (em.OwnSection, {"EI": 2.0, "EI_out": 8.0, "GJ": 1.5, "EA": 9.0, "weight": 0.1}),
    (em.LineLoad, {"shape": [[0.0, 1.0], [1.0, 2.0]], "direction": (0.0, -1.0)}),
    (em.PointForce, {"s": 0.5, "direction": (1.0, 0.0)}),
    (em.Couple, {"s": 0.5}),
    (em.Curvature, {"pattern": 1.0, "start": 0.1, "stop": 0.9}),
    (em.Tendon, {"offset": [[0.0, 0.1], [1.0, 0.1]], "start": 0.0, "stop": 0.5}),
    (em.Disc, {"centre": (0.0, 1.0), "radius": 1.0, "inside": False}),
    (em.HalfPlane, {"point": (0.0, 1.0), "normal": (0.0, 1.0)}),
    (em.Box, {"p": (0.0, 1.0), "q": (-1.0, 2.0)}),
    (em.Grid, {"p": (0.0, 1.0, 3), "q": (-1.0, 2.0, 2)}),
    (em.Spline, {"p": [0.0, 1.0, 3.0], "q": [1.0, 2.0, 2.0]}),
    (em.Rod, {"load": "uniform", "span": 0.8, "elements": 4, "degree": 5}),
    (em.Rod, {
        "ends": CLAMP_AND_PIN, "stiffness": [[0.0, 1.0], [1.0, 2.0]], "curvature": -1.0,
        "axial": 50.0, "rise": 0.1, "kinks": [0.4], "elements": 4, "degree": 4,
        "loads": {"P": {"term": "point force", "s": 0.5, "direction": (0.0, -1.0)}},
        "actuators": {"k": [{"term": "curvature", "start": 0.2, "stop": 0.7, "pattern": 1.0}]},
        "coordinates": {"turn": {"theta_A": -1.0}}, "EI": 2.0, "length": 3.0, "units": UNITS,
    }),
    (em.Rod, {"torsion": 0.7, "lateral": 1.0}),
    (em.Rod, {"section": {"kind": "round", "diameter": 2.0, "E": 7e4, "nu": 0.3}, "length": 300.0,
              "units": UNITS}),
    (em.Truss, {
        "joints": JOINTS, "bars": [("A", "B"), {"ends": ("B", "C"), "EA": 2.0, "EI": 0.1}],
        "supports": {"A": "xy", "C": "xy"}, "loads": {"F": {"B": (0.0, -1.0)}},
        "actuators": {"a": {"A-B": 1.0}}, "strain": "green", "units": UNITS,
    }),
    (em.Frame, {
        "joints": JOINTS, "supports": {"A": "fixed", "C": {"x": "held", "y": 5.0}},
        "members": [("A", "B"), {"ends": ("B", "C"), "EI": 2.0, "hinges": ["B"], "weight": 1.0}],
        "loads": {"F": {"B": (0.0, -1.0), "A-B": (0.0, -1.0)}, "g": {"weight": (0.0, -1.0)}},
        "actuators": {"a": {"curvature": {"A-B": 1.0}, "turn": {"A": 1.0}},
                      "b": {"length": {"B-C": 0.1}, "move": {"C": (0.1, 0.0)}}},
        "elements": 1, "degree": 4, "units": UNITS,
    }),
    (em.SpatialMember, {"joints": ("A", "B", "C"), "EI": 1.0, "EI_out": 2.0, "GJ": 0.5, "EA": 900.0,
                        "normal": (0.0, 0.0, 1.0), "curvature": 0.1, "strains": (0.0, 0.1, 0.0),
                        "length": 2.0, "hinges": {"B": (0.0, 0.0, 1.0), "C": "ball"},
                        "weight": 1.0, "inextensible": False}),
    (em.SpatialFrame, {
        "joints": IN_SPACE, "supports": {"A": "fixed", "C": {"x": "held", "y": 5.0, "z": "held"},
                                         "D": {"plane": (0.0, 1.0, 1.0), "rotation": "held"}},
        "members": [("A", "B", "C"), {"joints": ("B", "D"), "EI": 2.0, "hinges": ["B"],
                                      "weight": 1.0}],
        "loads": {"F": {"B": (0.0, 0.0, -1.0), "A-B": (0.0, 0.0, -1.0)},
                  "g": {"weight": (0.0, 0.0, -1.0)}},
        "actuators": {"a": {"curvature": {"A-B": (0.0, 0.0, 1.0)}, "turn": {"A": (0.0, 1.0, 0.0)}},
                      "b": {"length": {"B-C": 0.1}, "move": {"C": (0.1, 0.0, 0.0)}}},
        "elements": 1, "degree": 4, "units": UNITS,
    }),
    (em.EnergyStructure, {
        "energy": "x**4/4 - x**2/2 - p*x + 0*r", "unknowns": [SYMBOL],
        "parameters": [{"name": "p", "unit": "1", "scale": 1.0, "role": "load", "default": 0.0}],
        "draw": [["0", "0"], ["x", 1.0]], "supports": [{"point": 0, "kind": "pin", "angle": 0.1}],
        "forces": [{"point": 1, "force": ["0", "p"]}], "descriptors": {"twice": "2*x"},
        "definitions": {"r": "x + p"}, "coercive": True,
    }),
)  # fmt: skip


def made(kind: Any, given: Mapping[str, Any]) -> Any:
    with unchecked():
        return kind(**given)


@pytest.mark.parametrize(("kind", "given"), RIGHT, ids=[kind.__name__ for kind, _ in RIGHT])
def test_what_is_right_is_taken(kind, given):
    assert made(kind, given) is not None


def test_every_wrong_value_is_refused_in_one_line():
    """No raw error, nothing wrong is accepted silently, at whatever depth it stands."""
    leaks, calls = [], 0
    for kind, given in RIGHT:
        for name, value in given.items():
            for wrong in mutants(value, name):
                calls += 1
                told = outcome(kind, {**given, name: wrong})
                if told:
                    leaks.append(f"{kind.__name__}({name}={wrong!r:.90}): {told:.120}")
    assert not leaks, f"{len(leaks)} of {calls}:\n" + "\n".join(leaks[:150])
    assert calls >= LEAST_CALLS
