"""Fingerprints: the same short text for the same plain data."""

import hashlib
import json
from typing import Any

FINGERPRINT = 32
"""Hexadecimal digits."""


def fingerprint(content: Any) -> str:
    """Fingerprint of plain data; the order of keys does not count.

    Examples
    --------
    >>> fingerprint({"a": 1, "b": 2}) == fingerprint({"b": 2, "a": 1})
    True
    """
    text = json.dumps(content, sort_keys=True).encode()
    return hashlib.sha256(text).hexdigest()[:FINGERPRINT]
