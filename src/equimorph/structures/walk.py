"""Networks drawn as one line."""

import numpy as np
from jaxtyping import Int


def walk_along(ends: Int[np.ndarray, "edges 2"], joints: int) -> Int[np.ndarray, " steps"]:
    """Joints in the order of a walk along all edges, some of them there and back.

    It begins at joint 0 and stays in the part of the network that it can reach.
    """
    joined: list[list[int]] = [[] for _ in range(joints)]
    for first, second in ends.tolist():
        joined[first].append(second)
        joined[second].append(first)
    steps, way, useful = [0], [0], 0
    seen, walked = {0}, set()
    while way:
        here = way[-1]
        there = next((j for j in joined[here] if frozenset((here, j)) not in walked), None)
        if there is None:
            way.pop()
            steps += way[-1:]
            continue
        walked.add(frozenset((here, there)))
        steps.append(there)
        useful = len(steps)
        if there in seen:
            steps.append(here)
        else:
            seen.add(there)
            way.append(there)
    return np.array(steps[:useful])
