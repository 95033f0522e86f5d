"""Whether two records are the same, arrays bit for bit."""

from dataclasses import fields, is_dataclass
from enum import Enum
from types import FunctionType

import numpy as np

import equimorph as em


def assert_equal(one, other):
    """Whether two records have the same fields, arrays bit for bit."""
    assert type(one) is type(other)
    if isinstance(one, em.State | em.States):
        np.testing.assert_array_equal(one.z, other.z)
        np.testing.assert_array_equal(one.p, other.p)
    elif isinstance(one, em.Structure):
        assert one.signature == other.signature
    elif isinstance(one, em.Descriptor | str | type | None):
        assert one == other
    else:
        parts, others = _parts(one), _parts(other)
        if parts is None:
            np.testing.assert_array_equal(one, other)
        else:
            for pair in zip(parts, others, strict=True):
                assert_equal(*pair)


def _parts(record):
    """What a record consists of, or None."""
    if is_dataclass(record):
        return [
            getattr(record, each.name)
            for each in fields(record)
            if each.metadata != em.model.NOT_KEPT
        ]
    if isinstance(record, dict):
        return [*record, *record.values()]
    if isinstance(record, FunctionType):
        return [record.__qualname__]
    if type(record).__module__.startswith("equimorph") and not isinstance(record, Enum):
        return list(vars(record).values())
    return record if isinstance(record, tuple | list) else None
