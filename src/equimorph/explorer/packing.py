"""Arrays as one compressed text, which the page unpacks.

Whole numbers are written as differences from row to row, every column by itself, and all numbers
byte by byte (all first bytes, then all second ones), which compresses best.
"""

import base64
import json
import zlib
from collections.abc import Mapping
from typing import Any

import numpy as np

from equimorph.array_types import Num, UInt16
from equimorph.arrays import Values

TOP = 65535
"""Largest number of 16 bits."""
_KINDS = {"u1": "u8", "u2": "u16", "i4": "i32", "f4": "f32"}


def pack(arrays: Mapping[str, Num[np.ndarray, "..."]]) -> tuple[list[dict[str, Any]], str]:
    """Directory of arrays, and their bytes, compressed and written in base 64.

    Parameters
    ----------
    arrays
        By name, with one or two axes, of 8 or 16 bits without sign, of 32 bits, or single floats.

    Returns
    -------
    Name, kind, rows and columns of each, in the order of the bytes; the bytes as text.
    """
    directory: list[dict[str, Any]] = []
    chunks = []
    for name, array in arrays.items():
        rows = array.reshape(len(array), array.shape[1] if array.ndim > 1 else 1)
        columns = np.ascontiguousarray(rows.T)
        if array.dtype.kind != "f" and len(rows):
            first = columns[:, :1]
            steps = np.diff(columns.astype(np.int64), axis=1).astype(columns.dtype)
            columns = np.ascontiguousarray(np.concatenate([first, steps], axis=1))
        planes = columns.reshape(-1).view(np.uint8).reshape(-1, array.dtype.itemsize).T
        chunks.append(planes.tobytes())
        kind = _KINDS[array.dtype.str[1:]]
        directory.append({"name": name, "kind": kind, "rows": len(rows), "columns": rows.shape[1]})
    return directory, base64.b64encode(zlib.compress(b"".join(chunks), 9)).decode("ascii")


def quantise(values: Values) -> tuple[UInt16[np.ndarray, " lanes"], float, float]:
    """Finite values as whole numbers of 16 bits; the lowest value, and the value of one step."""
    known = np.where(np.isfinite(values), values, np.nan)
    if not np.isfinite(known).any():
        return np.zeros(len(values), np.uint16), 0.0, 0.0
    low = float(np.nanmin(known))
    step = float(np.nanmax(known) - low) / TOP
    shares = np.nan_to_num((known - low) / (step or 1.0), nan=0.0)
    return np.round(shares).astype(np.uint16), low, step


def json_in_html(data: Any) -> str:
    """JSON that can stand inside a script element: no character of it ends the element."""
    text = json.dumps(data, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
    return text.replace("<", "\\u003c").replace("\u2028", "\\u2028").replace("\u2029", "\\u2029")
