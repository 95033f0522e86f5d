"""A bistable network of rods: two arches between pins, their tops joined by a stiff post.

E = Σ ∫ ½ EI (θ' − κ₀)² ds − P work, inextensible arches of rise 0.3 over a span of 2; units of EI
and half the span. Free of stress as drawn, it stays inverted once it has been pressed over: the
post keeps it from tilting. Segments that bend (t) change the load at which it snaps.

Run it: python examples/network.py
"""

from dataclasses import dataclass

from matplotlib.figure import Figure

import equimorph as em

RISE, GAP = 0.3, 0.5
KAPPA = 2.0 * RISE / (1.0 + RISE**2)


@dataclass(frozen=True)
class Result:
    """The loads that press it over and pull it back, the inverted state, and the set."""

    loads: tuple[float, float]
    inverted: em.State
    eset: em.EquilibriumSet


def network(degree: int = 7) -> em.Frame:
    """Return two arches with their post."""
    joints: dict[str, tuple[float, float]] = {}
    members = [em.Member(("M1", "M2"), EI=20.0)]
    for i, y in ((1, 0.0), (2, GAP)):
        joints |= {f"L{i}": (-1.0, y), f"M{i}": (0.0, y + RISE), f"R{i}": (1.0, y)}
        pairs = ((f"L{i}", f"M{i}"), (f"M{i}", f"R{i}"))
        members += [em.Member(ends, curvature=-KAPPA) for ends in pairs]
    left, right = {"L1-M1": 1.0, "L2-M2": 1.0}, {"M1-R1": -1.0, "M2-R2": -1.0}
    return em.Frame(
        joints,
        members,
        {f"{side}{i}": "pinned" for side in "LR" for i in (1, 2)},
        {"P": {"M2": (0.0, -1.0)}},
        {"t": {"curvature": left | right}},
        degree=degree,
    )


def main(intervals: tuple[int, int] = (11, 11)) -> Result:
    """Find the stable states without load, the loads at which they end, and the set."""
    frame, height = network(), network().displacement("M2", "y")
    gentle = [frame.max_curvature <= 3]
    found = em.find_equilibria(frame, {"t": 0.0, "P": 0.0}, within=gentle).stable
    upright, inverted = max(found, key=height), min(found, key=height)
    press = em.lift(upright, {"P": 30.0}).end.state["P"]
    pull = em.lift(inverted, {"P": -30.0}).end.state["P"]
    box = em.Box(t=(-1.5, 1.5), P=(-8.0, 16.0))
    eset = em.equilibrium_set(frame, box, within=gentle, intervals=intervals)
    return Result((press, pull), inverted, eset)


def figure(result: Result) -> Figure:
    """Both states without load."""
    drawing = Figure(figsize=(5.0, 3.0), layout="constrained")
    axes = drawing.subplots(squeeze=False)[0, 0]
    for state in (network().natural_state(), result.inverted):
        axes.plot(*state.shape().T)
    axes.set(aspect="equal", xlabel="x", ylabel="y", title="stable without load")
    return drawing


if __name__ == "__main__":
    found = main()
    print("pressed over and pulled back by P =", *(f"{load:.4f}" for load in found.loads))
    print(found.inverted, f"margin {found.inverted.margin:.4f}")
    print(found.eset.audit)
    em.plotting.save(figure(found), ".", "network")
