"""Constraints in files: as plain data, by the names of their descriptors."""

import json

import pytest

from equimorph.model import Descriptor, ease
from equimorph.storage.owner import Owner, words_of
from equimorph.structures import Spring

SPRING = Spring()
MINE = Descriptor("mine", "1", lambda z, p: z[:, 0])


@pytest.mark.parametrize(
    "constraint",
    [SPRING.height <= 0.5, ease(SPRING.height >= -30.0), ease(MINE <= 0.0)],
    ids=str,
)
def test_a_constraint_comes_back_with_its_ease(constraint):
    owner = Owner(SPRING, {"mine": MINE})
    assert owner.constraint(json.loads(json.dumps(words_of(constraint)))) == constraint
