"""Compiled kernels that copy rows and lengthen tables, entry by entry.

An array assigned to a slice would be shorter, but for each number of axes the compiler then adds
the text of an error, made of strings, which takes it a second or more.
"""

import numpy as np

from equimorph.linalg.compiled import njit
from equimorph.linalg.kernels import FLAGS, INNER


@njit(**INNER)
def copy_row(source, i, target, j):
    """Row i of one table becomes row j of another, or of the same."""
    for k in range(source.shape[1]):
        target[j, k] = source[i, k]


@njit(**FLAGS)
def with_room(numbers, size):
    """The numbers, or, if there is no room for so many, a copy that is at least twice as long."""
    if size <= numbers.shape[0]:
        return numbers
    out = np.empty(max(size, 2 * numbers.shape[0]), numbers.dtype)
    for i in range(numbers.shape[0]):
        out[i] = numbers[i]
    return out


@njit(**FLAGS)
def rows_with_room(rows, size):
    """The rows, or, if there is no room for so many, a copy with at least twice as many."""
    if size <= rows.shape[0]:
        return rows
    out = np.empty((max(size, 2 * rows.shape[0]), rows.shape[1]), rows.dtype)
    for i in range(rows.shape[0]):
        copy_row(rows, i, out, i)
    return out
