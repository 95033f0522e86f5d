"""An arch in MuJoCo turns over under a load that its controller does not know.

The load, 2.5 λ_cr at first, walks by 1 % a step and jumps by 0.4; heights have 2 % noise.
Known answer: the inverted arch, without a snap. MuJoCo moves a chain of 20 links in time.
"""

from collections.abc import Mapping

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

import equimorph as em


def main(seed: int = 1) -> np.ndarray:
    """Rows of true and estimated load and measured crown height, one for each step."""
    arch = em.Rod()
    crown = arch.height(0.5)
    box, within = em.Box(Theta=(0.2, 2.5), Delta=(-2, 2)), [arch.max_curvature <= 20]
    eset = em.equilibrium_set(arch, box, fixed={"q": 2.5}, within=within, intervals=(12, 21))
    inverted, upright = sorted(eset.at(Theta=1, Delta=0).stable, key=crown)
    noise = {arch.height(s): 0.005 for s in (1 / 3, 1 / 2, 2 / 3)}
    controller = em.Controller(
        eset, inverted, noise, {"q": 0.025}, jumps={"q": 0.4}, margin=0.05, stride=0.1
    )
    settings = em.ReplaySettings(links=20, step=0.05, hold=5.0)
    plant = em.SimulatedPlant(upright, rate=0.1, settings=settings)
    random, load = np.random.default_rng(seed), 2.5
    rows: list[tuple[float, ...]] = []
    belief = controller.start(upright)

    def write(command: Mapping[str, float]) -> None:
        nonlocal load
        load += 0.025 * random.standard_normal() + (0.4 if len(rows) == 15 else 0.0)
        plant.move({**command, "q": load})

    def read() -> dict[em.Descriptor, float]:
        return {what: plant.measure(what) + error * random.standard_normal()
                for what, error in noise.items()}  # fmt: skip

    while belief.status != em.ControlStatus.ARRIVED and len(rows) < 150:
        write(controller.command(belief))
        belief = controller.step(belief, read())
        rows.append((load, belief.state["q"], plant.measure(crown)))
    return np.array(rows)


def figure(result: np.ndarray) -> Axes:
    """Load, what is believed of it, and the height of the crown."""
    steps = np.arange(len(result))
    with em.plotting.house_style():
        above, below = Figure(figsize=(3.4, 3.2), layout="constrained").subplots(2, sharex=True)
        above.step(steps, result[:, 0], label="load", where="post")
        above.plot(steps, result[:, 1], ".", label="estimated")
        above.set_ylabel(r"load, $\lambda_\mathrm{cr}$")
        above.legend(frameon=False)
        below.plot(steps, result[:, 2])
        below.set(xlabel="step", ylabel="height of the crown, L")
    return below


if __name__ == "__main__":
    result = main()
    print(f"{len(result)} steps, crown at {result[-1, 2]:.4f}")
    em.plotting.save(figure(result), ".", "closed_loop")
