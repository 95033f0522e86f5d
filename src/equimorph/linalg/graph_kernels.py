"""Connected pieces of graphs."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER


@njit(**INNER)
def root_of(before, node):
    """First node of a piece, the way to which is made shorter."""
    while before[node] != node:
        before[node] = before[before[node]]
        node = before[node]
    return node


@njit(**FLAGS)
def join_nodes(count, pairs):
    """Number of the piece that each node belongs to, in the order of their first nodes."""
    before = np.arange(count)
    for i in range(pairs.shape[0]):
        one, other = root_of(before, pairs[i, 0]), root_of(before, pairs[i, 1])
        if one < other:
            before[other] = one
        else:
            before[one] = other
    numbers, many = np.empty(count, np.int64), 0
    for node in range(count):
        first = root_of(before, node)
        if first == node:
            numbers[node] = many
            many += 1
        else:
            numbers[node] = numbers[first]
    return numbers


@njit(**FLAGS)
def before_in_chain(count, first, second, costs):
    """Node before each on the cheapest chain from the first node, or −1 where none leads there.

    Links lead from lower to higher numbers, in the order of their first ends.
    """
    before, least = np.full(count, -1), np.full(count, np.inf)
    least[0] = 0.0
    for link in range(first.shape[0]):
        total = least[first[link]] + costs[link]
        if total < least[second[link]]:
            least[second[link]], before[second[link]] = total, first[link]
    return before
