"""Random Green-strain trusses with dead loads, and their forces by hand for complex arguments."""

from dataclasses import dataclass

import numpy as np

import equimorph as em


@dataclass(frozen=True)
class GreenTruss:
    """Bars with W = ½ EA l₀ ε², ε = (l²/l₀² − 1)/2; d = drawn + change·u are their vectors.

    change (bars, 2, unknowns); pull: dead load on each unknown.
    """

    truss: em.Truss
    drawn: np.ndarray
    change: np.ndarray
    stiffness: np.ndarray
    pull: np.ndarray

    def __call__(self, u):
        """∂E/∂u and its Jacobian, over EA/l₀ of a unit bar."""
        bars, _, n = self.change.shape
        d = self.drawn + (u @ self.change.reshape(-1, n).T).reshape(-1, bars, 2)
        rest = np.linalg.norm(self.drawn, axis=1)
        strain = 0.5 * ((d**2).sum(axis=2) / rest**2 - 1.0)
        weight = self.stiffness / rest
        along = (d.swapaxes(0, 1) @ self.change).swapaxes(0, 1)
        force = ((weight * strain)[:, None] @ along)[:, 0] - self.pull
        alike = np.einsum("bcu,bcv->buv", self.change, self.change).reshape(bars, -1)
        bent = ((weight * strain) @ alike).reshape(-1, n, n)
        return force, bent + (along * (weight / rest**2)[:, None]).swapaxes(1, 2) @ along


def random_green_truss(unknowns: int, generator: np.random.Generator) -> GreenTruss:
    """Low two-bar trusses of random shape, joined by bars of random stiffness."""
    free = -(-unknowns // 2)
    places, supports, pairs, stiffness = {}, {}, [], []
    for k in range(free):
        left, top, right = f"L{k}", f"T{k}", f"R{k}"
        places[left] = (2.5 * k - generator.uniform(0.8, 1.2), 0.0)
        places[top] = (2.5 * k, generator.uniform(0.15, 0.6))
        places[right] = (2.5 * k + generator.uniform(0.8, 1.2), 0.0)
        supports |= {left: "xy", right: "xy"}
        pairs += [(left, top), (top, right)]
        stiffness += generator.uniform(0.5, 2.0, 2).tolist()
        if k:
            pairs.append((f"T{k - 1}", top))
            stiffness.append(10.0 ** generator.uniform(-2.0, 0.0))
    if unknowns % 2:
        supports["T0"] = "x"
    moves = [
        (f"T{k}", axis) for k in range(free) for axis in (0, 1) if k or not unknowns % 2 or axis
    ]
    pull = 0.003 * generator.normal(size=len(moves))
    loads = {f"T{k}": [0.0, 0.0] for k in range(free)}
    change = np.zeros((len(pairs), 2, len(moves)))
    for number, (name, axis) in enumerate(moves):
        loads[name][axis] = pull[number]
        for bar, (first, second) in enumerate(pairs):
            change[bar, axis, number] = float(second == name) - float(first == name)
    given = [em.Bar(pair, EA=EA) for pair, EA in zip(pairs, stiffness, strict=True)]
    truss = em.Truss(places, given, supports, {"F": loads}, strain="green")
    drawn = np.array([np.subtract(places[b], places[a]) for a, b in pairs])
    return GreenTruss(truss, drawn, change, np.array(stiffness), pull)
