"""What of a result is written to files."""

from collections.abc import Mapping
from types import MappingProxyType

NOT_KEPT: Mapping[str, bool] = MappingProxyType({"kept": False})
"""Metadata of a dataclass's field that files leave out; it needs a default."""
