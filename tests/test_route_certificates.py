"""Route certificates: what is proved is accepted by a checker that shares no code, tampering not.

The checker differentiates the energy of the certificate anew, by automatic differentiation.
"""

import copy
import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import equimorph as em
from oracles.polynomial import bead_on_a_circle
from oracles.specimens import toggle
from typecheck import unchecked

CHECKER = Path(__file__).parents[1] / "checker" / "check_route.py"


@pytest.fixture(scope="module")
def check():
    """The checker, loaded from its file."""
    spec = importlib.util.spec_from_file_location("check_route", CHECKER)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)

    def accepts(certificate):
        with np.errstate(all="ignore"):
            return module.check(certificate)

    return accepts


def shallow(strain):
    return em.Truss(
        {"A": (-1.0, 0.0), "B": (0.0, 0.2), "C": (1.0, 0.0)}, [("A", "B"), ("B", "C")],
        supports={"A": "xy", "C": "xy"}, loads={"P": {"B": (0.0, -1.0)}},
        actuators={"a": {"A-B": 1.0}}, strain=strain,
    ).natural_state()  # fmt: skip


def arch():
    rod = em.Rod(elements=4, degree=5)
    return em.lift(rod.natural_state(Theta=1.0, Delta=0.0), {"q": 2.5}).end.state


def formula():
    """A pendulum with powers, and a bead on a circle."""
    return em.EnergyStructure(
        "a**3/3 + (a - b)**2/2 + 1 - cos(a) + b**4 - F*sin(b)/(2 + b)", ["a", "b"],
        [em.Parameter("F", "N", 1.0, "load", 0.0)],
    ).natural_state()  # fmt: skip


def bead():
    return em.EnergyStructure(
        "m*y - F*x", ["x", em.Unknown("y", "-1")],
        [em.Parameter("F", "N", 1.0, "load", 0.0), em.Parameter("m", "N", 1.0, "fixed", 1.0)],
        constraints=["x**2 + y**2 - 1"],
    ).natural_state()  # fmt: skip


def stretchable():
    return em.Rod(
        axial=100.0, ends=("clamped", "free"), curvature=0.5, elements=2, degree=5,
        loads={"P": em.PointForce(1.0)},
    ).natural_state()  # fmt: skip


def pressed():
    """One end slides, so that pressure works on the chord, too."""
    rod = em.Rod(ends=("clamped", "sliding"), loads={"p": em.Pressure()}, elements=2, degree=5)
    return rod.natural_state(Theta=0.5)


def portal():
    """A hinge, members that stretch, and one that grows."""
    joints = {"A": (0.0, 0.0), "B": (0.0, 1.0), "C": (1.0, 1.0), "D": (1.0, 0.0)}
    members = [
        em.Member(("A", "B"), EA=40.0), ("B", "C"), em.Member(("C", "D"), hinges=("C",)),
    ]  # fmt: skip
    return em.Frame(
        joints, members, {"A": "fixed", "D": {"x": "held", "y": "held", "angle": 3.0}},
        loads={"P": {"B": (0.3, -1.0)}}, actuators={"a": {"length": {"A-B": 1.0}}},
        elements=1, degree=5,
    ).natural_state()  # fmt: skip


def pressed_frame():
    """Two pressures around a corner, one of them on a chain whose end slides."""
    joints = {"A": (0.0, 0.0), "B": (0.0, 1.0), "C": (1.0, 0.0)}
    members = [("A", "B"), em.Member(("C", "B"), curvature=0.3), ("A", "C")]
    return em.Frame(
        joints, members, {"A": "fixed", "C": "y"},
        loads={"p": {"pressure": ["A", "B", "C"]}, "o": {"pressure": ["A", "C", "B", "A"]}},
        elements=1, degree=5,
    ).natural_state()  # fmt: skip


CASES = {
    "rod": (arch, [{"Theta": 1.03}, {"Delta": 0.02}]),
    "green truss": (lambda: shallow("green"), [{"P": 3e-4}, {"a": 0.003}]),
    "engineering truss": (lambda: shallow("engineering"), [{"P": 2e-4}]),
    "stretchable rod": (stretchable, [{"P": 0.01}]),
    "pressed rod": (pressed, [{"p": 0.05}]),
    "frame": (lambda: toggle().natural_state(), [{"P": 0.1}, {"a": 0.01}]),
    "frame of several kinds": (portal, [{"P": 0.1}, {"a": 0.005}]),
    "pressed frame": (pressed_frame, [{"p": 0.1}, {"o": 0.1}]),
    "spring": (lambda: em.Spring().natural_state(x_l=0.8), [{"F": 0.01}]),
    "formula": (formula, [{"F": 0.05}]),
    "constrained formula": (bead, [{"F": 0.02}]),
}


@pytest.fixture(scope="module")
def certificates(tmp_path_factory):
    folder, found = tmp_path_factory.mktemp("certificates"), {}
    for name, (start, steps) in CASES.items():
        with unchecked():
            proof = em.verify(steps, start(), proof=True).proof
        path = em.storage.write_certificate(proof, folder / f"{name}.json")
        found[name] = json.loads(path.read_text())
    return folder, found


def test_certificates_are_accepted(certificates, check):
    for name, certificate in certificates[1].items():
        said = check(certificate)
        assert said.startswith(f"{len(certificate['tubes'])} segments, margin "), name


def test_the_checker_runs_without_the_package(certificates):
    """In a process that cannot import it."""
    place = certificates[0] / "spring.json"
    done = subprocess.run(
        [sys.executable, "-I", str(CHECKER), str(place)], capture_output=True, text=True, check=True
    )
    assert done.stdout.startswith("accepted: ")
    place.write_text(place.read_text().replace('"index": 0', '"index": 1'))
    wrong = [sys.executable, "-I", str(CHECKER), str(place)]
    done = subprocess.run(wrong, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr == "refused: only index 0 is stable\n"


def shorten(certificate, segments):
    """Certificate of the first segments."""
    short = {"tubes": segments, "p": segments + 1, "z": segments + 1}
    return {**certificate, **{name: certificate[name][:count] for name, count in short.items()}}


def leave_tube(data, tubes, k, generator):
    entry = int(generator.integers(tubes.shape[1]))
    data["z"][k][entry] += 30.0 * tubes[:, entry].max() * generator.choice([-1.0, 1.0])


def change_tube(data, tubes, k, generator):
    segment = min(k, len(tubes) - 1)
    factor = generator.choice([-1.0, 0.0, 1e-3, 0.05, 1e5, np.nan])
    data["tubes"][segment] = (tubes[segment] * factor).tolist()


def move_corner(data, tubes, k, generator):
    data["p"][k][0] += 0.02 * generator.choice([-1.0, 1.0])


def change_index(data, tubes, k, generator):
    data["index"] = int(generator.choice([-1, 1, 2]))


def change_weights(data, tubes, k, generator):
    data["mass"] = (generator.choice([2.0, 3.0, 10.0]) * np.array(data["mass"])).tolist()


def raise_margin(data, tubes, k, generator):
    data["margin"] *= generator.choice([2.0, 3.0, 10.0])


def leave_gap(data, tubes, k, generator):
    """With its states or without; and another corner at the end."""
    inner = 1 + k % (len(tubes) - 1)
    for name in ("p", "z")[: generator.integers(1, 3)]:
        del data[name][inner]
    if len(data["p"]) < len(data["z"]):
        data["p"].append(data["p"][-1])


def change_structure(data, tubes, k, generator):
    table = {"planar": "sine", "truss": "stiffness"}[data["structure"]["kind"]]
    data["structure"][table] = (1.05 * np.array(data["structure"][table])).tolist()


TAMPERS = [
    leave_tube, change_tube, move_corner, change_index,
    change_weights, raise_margin, leave_gap, change_structure,
]  # fmt: skip


def test_a_hundred_tampered_certificates_are_refused(certificates, check):
    """Each statement is made wrong, or is one that its numbers do not prove."""
    generator = np.random.default_rng(4)
    right = [shorten(certificates[1][name], 2) for name in ("rod", "green truss")]
    for trial in range(100):
        wrong = copy.deepcopy(right[trial % 4 > 0])
        tubes = np.array(wrong["tubes"])
        k = int(generator.integers(len(wrong["p"])))
        TAMPERS[int(generator.integers(len(TAMPERS)))](wrong, tubes, k, generator)
        with pytest.raises(ValueError, match=r"segment|match|finite|positive|stable"):
            check(wrong)
    assert all(check(each) for each in right)


def test_what_is_not_proved_has_no_certificate(tmp_path):
    near = bead_on_a_circle().state(0.0, 1.0, 1.0, g=1.0)
    supported = em.verify([{"h": 0.01}], near, proof=True).proof
    with pytest.raises(em.InputError, match="must be proved; got one that is supported"):
        em.storage.write_certificate(supported, tmp_path / "no.json")
    rest = em.Spring().natural_state(x_l=0.8)
    proof = em.verify([{"F": 0.001}], rest, proof=True).proof
    with pytest.raises(em.InputError, match=r"must end in \.json"):
        em.storage.write_certificate(proof, tmp_path / "no.csv")
    steep = em.EnergyStructure(
        "phi**2 - M*tan(phi)", "phi", [em.Parameter("M", "N", 1.0, "load", 0.0)]
    )
    proof = em.verify([{"M": 0.01}], steep.natural_state(), proof=True).proof
    with pytest.raises(em.InputError, match="written in numbers"):
        em.storage.write_certificate(proof, tmp_path / "no.json")
