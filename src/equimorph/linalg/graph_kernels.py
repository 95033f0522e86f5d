"""Connected pieces of graphs, and least cuts between groups of their nodes."""

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
def side_of_least_cut(links, capacity, first, second):
    """Nodes on the first group's side of the least cut between two groups, as few as possible.

    Preflows by heights [GoldbergTarjan1988]_. links (m, 2); capacity (m,), whole numbers; first and
    second, one flag a node. Arc k leads from node k mod 2 of link k div 2 to the other one.
    """
    n, arcs = len(first), 2 * len(links)
    starts, found = np.zeros(n + 1, np.int64), np.empty(arcs, np.int64)
    room, excess = np.empty(arcs, np.int64), np.zeros(n, np.int64)
    for k in range(arcs):
        starts[links[k >> 1, k & 1] + 1] += 1
        room[k] = capacity[k >> 1]
    for i in range(n):
        starts[i + 1] += starts[i]
    at = starts[:-1].copy()
    for k in range(arcs):
        tail, head = links[k >> 1, k & 1], links[k >> 1, 1 - (k & 1)]
        found[at[tail]] = k
        at[tail] += 1
        if first[tail] and not first[head]:  # sends as much as it can
            excess[head] += capacity[k >> 1]
    for k in range(arcs):
        if first[links[k >> 1, k & 1]]:
            room[k ^ 1], room[k] = room[k ^ 1] + room[k], 0
    height, queue = np.empty(n, np.int64), np.empty(n, np.int64)
    begin, count, raised = 0, 0, n
    while True:
        if 2 * raised >= n:  # heights become the numbers of arcs on the way to the second group
            begin, count, raised, reached = 0, 0, 0, 0
            for i in range(n):
                height[i], at[i] = 0 if second[i] else n, starts[i]
                if second[i]:
                    queue[reached] = i
                    reached += 1
            i = 0
            while i < reached:
                for place in range(starts[queue[i]], starts[queue[i] + 1]):
                    k = found[place]
                    tail = links[k >> 1, 1 - (k & 1)]
                    if height[tail] == n and room[k ^ 1] > 0:
                        height[tail] = height[queue[i]] + 1
                        queue[reached] = tail
                        reached += 1
                i += 1
            for i in range(reached):
                if excess[queue[i]] > 0 and not second[queue[i]]:
                    queue[count] = queue[i]
                    count += 1
        if count == 0:
            break
        own = queue[begin]
        begin, count = (begin + 1) % n, count - 1
        while excess[own] > 0 and height[own] < n:
            if at[own] == starts[own + 1]:
                low = n - 1
                for place in range(starts[own], starts[own + 1]):
                    k = found[place]
                    if room[k] > 0:
                        low = min(low, height[links[k >> 1, 1 - (k & 1)]])
                height[own], at[own], raised = low + 1, starts[own], raised + 1
                continue
            k = found[at[own]]
            head = links[k >> 1, 1 - (k & 1)]
            if room[k] > 0 and height[own] == height[head] + 1:
                amount = min(excess[own], room[k])
                room[k], room[k ^ 1] = room[k] - amount, room[k ^ 1] + amount
                if excess[head] == 0 and not second[head]:
                    queue[(begin + count) % n] = head
                    count += 1
                excess[own], excess[head] = excess[own] - amount, excess[head] + amount
            else:
                at[own] += 1
    # what did not arrive stays on the first group's side of every least cut
    side, count = first.copy(), 0
    for i in range(n):
        side[i] |= excess[i] > 0 and not second[i]
        if side[i]:
            queue[count] = i
            count += 1
    i = 0
    while i < count:
        for place in range(starts[queue[i]], starts[queue[i] + 1]):
            k = found[place]
            head = links[k >> 1, 1 - (k & 1)]
            if room[k] > 0 and not side[head]:
                side[head] = True
                queue[count] = head
                count += 1
        i += 1
    return side
