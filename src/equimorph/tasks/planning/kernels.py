"""Compiled loops of planners."""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.row_kernels import copy_row, rows_with_room, with_room


@njit(nogil=True)
def search_classes(starts, others, costs, changes, ends, limits, ratio):
    """Dijkstra's algorithm on pairs of a node and a class, until enough classes reach the goal.

    starts, others, costs, changes: links from each node on, with what they add to a class; ends:
    start and goal; limits: paths, visits of a node, and turns in a class at most, and the number of
    the path which others may not exceed by more than a ratio. Return the labels of the goal, and
    node, class and parent of each label, and the classes.
    """
    holes, links = changes.shape[1], others.shape[0]
    room = links + 16
    key, what = np.empty(room), np.empty((room, 3), np.int64)
    classes, known = np.zeros((64, holes), np.int64), 1
    labels, made = np.empty((1024, 3), np.int64), 0
    # nodes and classes that were met: the least cost so far, or −1 where the label is final
    head, following = np.full(starts.shape[0] - 1, -1), np.empty(1024, np.int64)
    of_class, least, met = np.empty(1024, np.int64), np.empty(1024), 1
    head[ends[0]], following[0], of_class[0], least[0] = 0, -1, 0, 0.0
    visits = np.zeros(starts.shape[0] - 1, np.int64)
    found, count, most = np.empty(limits[0], np.int64), 0, np.inf
    key[0], what[0, 0], what[0, 1], what[0, 2], size = 0.0, ends[0], 0, -1, 1
    while size > 0 and count < limits[0] and key[0] <= most:
        cost, node, own, parent = key[0], what[0, 0], what[0, 1], what[0, 2]
        size -= 1
        key[0] = key[size]
        copy_row(what, size, what, 0)
        _sift_down(key, what, classes, size)
        place = _place_of(head, following, of_class, node, own)
        if visits[node] >= limits[1] or cost != least[place]:
            continue
        visits[node] += 1
        if made == labels.shape[0]:
            labels = rows_with_room(labels, made + 1)
        labels[made, 0], labels[made, 1], labels[made, 2] = node, own, parent
        least[place], made = -1.0, made + 1
        if node == ends[1]:
            found[count] = made - 1
            count += 1
            if count == limits[3]:
                most = ratio * cost
            continue
        for link in range(starts[node], starts[node + 1]):
            if known == classes.shape[0]:
                classes = rows_with_room(classes, known + 1)
            there = _class_after(classes, known, own, changes[link], limits[2])
            if there < 0:
                continue
            known = max(known, there + 1)
            other, total = others[link], cost + costs[link]
            place = _place_of(head, following, of_class, other, there)
            if place >= 0 and total >= least[place]:
                continue
            if place < 0:
                if met == least.shape[0]:
                    of_class, least = with_room(of_class, met + 1), with_room(least, met + 1)
                    following = with_room(following, met + 1)
                place, met = met, met + 1
                following[place], head[other], of_class[place] = head[other], place, there
            least[place] = total
            if size == key.shape[0]:
                key, what = with_room(key, size + 1), rows_with_room(what, size + 1)
            key[size] = total
            what[size, 0], what[size, 1], what[size, 2] = other, there, made - 1
            size += 1
            _sift_up(key, what, classes, size - 1)
    return found[:count], labels[:made], classes[:known]


@njit(nogil=True)
def _class_after(classes, known, own, change, most):
    """Number of a class plus a change, entered if it is new; −1 if it turns too often."""
    passes = False
    for hole in range(change.shape[0]):
        passes = passes or change[hole] != 0
        if abs(classes[own, hole] + change[hole]) > most:
            return -1
    if not passes:
        return own
    for each in range(known):
        same = True
        for hole in range(change.shape[0]):
            same = same and classes[each, hole] == classes[own, hole] + change[hole]
        if same:
            return each
    for hole in range(change.shape[0]):
        classes[known, hole] = classes[own, hole] + change[hole]
    return known


@njit(nogil=True)
def _place_of(head, following, of_class, node, own):
    """Place of a node in a class among those that were met, or −1."""
    place = head[node]
    while place >= 0 and of_class[place] != own:
        place = following[place]
    return place


@njit(nogil=True)
def _precedes(key, what, classes, one, other):
    """Whether one entry comes before another: by cost, node, class and parent."""
    if key[one] != key[other]:
        return key[one] < key[other]
    if what[one, 0] != what[other, 0]:
        return what[one, 0] < what[other, 0]
    first, second = what[one, 1], what[other, 1]
    for hole in range(classes.shape[1]):
        if classes[first, hole] != classes[second, hole]:
            return classes[first, hole] < classes[second, hole]
    return what[one, 2] < what[other, 2]


@njit(nogil=True)
def _exchange(key, what, one, other):
    """Exchange two entries."""
    key[one], key[other] = key[other], key[one]
    for k in range(3):
        what[one, k], what[other, k] = what[other, k], what[one, k]


@njit(nogil=True)
def _sift_up(key, what, classes, place):
    """Move an entry of a heap to its place, towards the first one."""
    while place > 0:
        above = (place - 1) // 2
        if not _precedes(key, what, classes, place, above):
            return
        _exchange(key, what, place, above)
        place = above


@njit(nogil=True)
def _sift_down(key, what, classes, size):
    """Move the first entry of a heap to its place."""
    place = 0
    while True:
        least = place
        for below in (2 * place + 1, 2 * place + 2):
            if below < size and _precedes(key, what, classes, below, least):
                least = below
        if least == place:
            return
        _exchange(key, what, place, least)
        place = least
