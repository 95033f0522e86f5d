"""Times of Newton steps of discrete structures, through the contract; compilation apart.

The step is what continuation takes: residual, parameter column, matrix, inertia, and the bordered
solution for two right sides. `extra_info` records lanes and size.
"""

from itertools import pairwise

import numpy as np
import pytest

from equimorph.model import Parameter
from equimorph.structures import (
    Couple,
    Curvature,
    End,
    EnergyStructure,
    Frame,
    LineLoad,
    PointForce,
    Pressure,
    Rod,
    SpatialRod,
    Tendon,
    Truss,
    Unknown,
)


def chain(links):
    """Hinged links of length 1/n with hinge springs between turned ends a span nu apart."""
    n, angles = links, [f"phi{i}" for i in range(links)]
    inner = " + ".join(f"({b} - {a})**2" for a, b in pairwise(angles))
    along, across = (" + ".join(f"{f}({angle})" for angle in angles) for f in ("cos", "sin"))
    load = " + ".join(f"{n - i}*sin({angle})" for i, angle in enumerate(angles))
    return EnergyStructure(
        f"{n}*(bend/2 + (phi0 - Theta)**2 + (phi{n - 1} + Theta)**2) + q*({load})/{n}**2",
        [Unknown(a, f"Theta*({n - 1 - 2 * i})/{n}", (-2.0, 2.0)) for i, a in enumerate(angles)],
        [
            Parameter("Theta", "rad", 1.0, "actuator", 1.0),
            Parameter("q", "1", 10.0, "load"),
            Parameter("nu", "L", 1.0, "actuator", 0.8414, 0.0, 1.0),
        ],
        constraints=[f"({along})/{n} - nu", f"({across})/{n}"],
        definitions={"bend": inner},
    )


def dense_energy(unknowns):
    """Every unknown with every other one: no sparsity at all."""
    names = [f"x{i}" for i in range(unknowns)]
    total = " + ".join(names)
    squares = " + ".join(f"{name}**2" for name in names)
    return EnergyStructure(
        f"({squares})/2 + exp(-({total})**2/{unknowns}) - F*x0",
        names,
        [Parameter("F", "1", 1.0, "load")],
    )


def bridge(bars):
    """Girder of square bays with one diagonal each, four bars a bay; the first chord actuated."""
    bays = bars // 4
    joints = {f"{row}{i}": (i, height) for i in range(bays + 1) for row, height in ("b0", "t1")}
    joints = {name: (float(x), float(y)) for name, (x, y) in joints.items()}
    pairs = [("b0", "t0")]
    for i in range(bays):
        pairs += [(f"b{i}", f"b{i + 1}"), (f"t{i}", f"t{i + 1}"), (f"t{i}", f"b{i + 1}")]
        pairs += [(f"b{i + 1}", f"t{i + 1}")]
    middle = f"b{bays // 2}"
    return Truss(
        joints,
        pairs[1:],
        {"b0": "xy", "t0": "x", f"b{bays}": "y"},
        {"F": {middle: (0.0, -1.0)}},
        {"a": {"b0-b1": 1.0}},
    )


def ladder(unknowns):
    """Bays of three inextensible members of 16 nodes, held at one end; one chord actuated."""
    bays = round(unknowns / 49)
    joints = {f"{row}{i}": (i, height) for i in range(bays + 1) for row, height in ("b0", "t1")}
    joints = {name: (float(x), float(y)) for name, (x, y) in joints.items()}
    pairs = []
    for i in range(bays):
        pairs += [(f"b{i}", f"b{i + 1}"), (f"t{i}", f"t{i + 1}"), (f"b{i + 1}", f"t{i + 1}")]
    return Frame(
        joints,
        pairs,
        {"b0": "fixed", "t0": "fixed"},
        {"F": {f"t{bays}": (0.0, -1.0)}},
        {"a": {"curvature": {"b0-b1": 1.0}}},
    )


@pytest.mark.parametrize("lanes", [100, 4096])
@pytest.mark.parametrize(
    ("make", "size"),
    [(chain, 40), (dense_energy, 40), (bridge, 40), (ladder, 300)],
    ids=["chain of 40", "dense 40", "truss of 40 bars", "frame of 294"],
)
def bench_newton_step(benchmark, make, size, lanes):
    structure = make(size)
    generator = np.random.default_rng(0)
    p = np.tile([parameter.default for parameter in structure.parameters], (lanes, 1))
    z = 0.1 * structure.sample(p, generator)
    dp, row, one = np.ones_like(p), generator.normal(size=z.shape), np.ones(lanes)
    step = benchmark.pedantic(
        structure.advance, (z, p, dp, row, one, one), rounds=40, warmup_rounds=2
    )
    assert np.isfinite(step.dz).all()
    time = benchmark.stats.stats.median if benchmark.stats else np.nan
    benchmark.extra_info |= {
        "lanes": lanes,
        "size": structure.size,
        "us per lane": 1e6 * time / lanes,
        "largest residual": float(step.residual.max()),
    }


def rod_with_every_option():
    """Springs, varying stiffness and curvature, extensible, a tendon, seven amplitudes."""
    return Rod(
        ends=(End(angle=0.3, y=5.0), End(x=5.0)),
        stiffness=[[0, 1], [1, 2]],
        curvature=[[0, 0], [1, 1]],
        axial=50.0,
        actuators={"k": Curvature(1.0, 0.0, 0.5), "T": Tendon(0.05)},
        loads={
            "q": LineLoad(direction=(0.3, -1.0)),
            "w": LineLoad("left-half"),
            "P": PointForce(0.5),
            "M": Couple(0.5),
        },
    )


def rod_with_a_tendon():
    """A soft arm: three curvatures, a tendon, its weight and a tip load."""
    thirds = {f"k{i}": Curvature(1.0, i / 3, (i + 1) / 3) for i in range(3)}
    return Rod(
        ends=("clamped", "free"),
        actuators={**thirds, "T": Tendon(0.05)},
        loads={"q": LineLoad(), "P": PointForce(1.0)},
    )


def rod_under_pressure():
    """An arch under outside pressure: a dense matrix, factored by pivoting."""
    return Rod(ends=("clamped", "pinned"), curvature=-2.0, loads={"p": Pressure()}, span=0.82)


def round_rod_in_space():
    """The round arch in space: quaternions at 37 nodes."""
    return SpatialRod(torsion=0.77, lateral=1.0)


def stretching_rod_in_space():
    """The same, extensible and shearable."""
    return SpatialRod(torsion=0.77, lateral=1.0, axial=50.0, shear=20.0)


RODS = {
    "all": rod_with_every_option, "arm": rod_with_a_tendon, "pressure": rod_under_pressure,
    "in space": round_rod_in_space, "stretching in space": stretching_rod_in_space,
}  # fmt: skip


@pytest.mark.parametrize("lanes", [100, 4096])
@pytest.mark.parametrize("make", RODS.values(), ids=RODS)
def bench_newton_step_of_a_general_rod(benchmark, make, lanes):
    structure = make()
    generator = np.random.default_rng(0)
    p = np.tile([parameter.default or 0.3 for parameter in structure.parameters], (lanes, 1))
    z = 0.3 * structure.sample(p, generator)
    dp, row, one = np.ones_like(p), generator.normal(size=z.shape), np.ones(lanes)
    step = benchmark.pedantic(
        structure.advance, (z, p, dp, row, one, one), rounds=40, warmup_rounds=2
    )
    assert np.isfinite(step.dz).all()
    time = benchmark.stats.stats.median if benchmark.stats else np.nan
    benchmark.extra_info |= {
        "lanes": lanes,
        "size": structure.size,
        "us per lane": 1e6 * time / lanes,
        "largest residual": float(step.residual.max()),
    }
