"""Families of structures whose designs are tested."""

import equimorph as em

NODES = (0.0, 0.25, 0.5, 0.75, 1.0)
MIRRORED = (0, 1, 2, 1, 0)


def arch(k, b):
    """Arch with intrinsic curvature and stiffness at three symmetric places each."""
    curvature, stiffness = (
        [[s, float(values[i])] for s, i in zip(NODES, MIRRORED, strict=True)] for values in (k, b)
    )
    return em.Rod(load="uniform", stiffness=stiffness, curvature=curvature)


def volume(k, b):
    """∫ B ds of the arch."""
    del k
    return (b[0] + 2.0 * b[1] + b[2]) / 4.0


ARCH = {"k": ([-8.0] * 3, [8.0] * 3, [0.0] * 3), "b": ([0.4] * 3, [2.5] * 3, [1.0] * 3)}


def strip(EI, length, tip):
    """A cantilever in N and m, whose stiffness falls to a share of it at the tip."""
    return em.Rod(
        ends=("clamped", "free"), EI=EI, length=length, elements=3,
        stiffness=[[0.0, 1.0], [1.0, tip]], curvature=[[0.0, 0.3], [1.0, 0.3]],
        loads={"P": em.PointForce(1.0), "H": em.PointForce(1.0, direction=(-1.0, 0.0))},
    )  # fmt: skip


STRIP = {"EI": (0.01, 0.03, 0.02), "length": (0.3, 0.6, 0.5), "tip": (0.3, 1.0, 0.6)}


def truss(rise, half):
    """Two bars that lean against each other, which may only move up and down."""
    joints = {"A": (-half, 0.0), "B": (0.0, rise), "C": (half, 0.0)}
    held = {"A": "xy", "B": "x", "C": "xy"}
    return em.Truss(joints, [("A", "B"), ("B", "C")], held, {"F": {"B": (0.0, -1.0)}})


TRUSS = {"rise": (0.05, 0.4, 0.2), "half": (0.8, 1.2, 1.0)}
