"""To what the records of a file belong, which they refer to by names."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from equimorph.equilibria import worst_named
from equimorph.model import Constraint, Descriptor
from equimorph.structures import Structure


@dataclass(frozen=True)
class Owner:
    """The structure of all records of a file, and descriptors that only the caller has."""

    structure: Structure
    """Knows its own descriptors by their names."""
    descriptors: Mapping[str, Descriptor] = field(default_factory=dict)
    """Descriptors that users made of functions, by their names."""

    def descriptor(self, name: str) -> Descriptor:
        """Descriptor of a name that the structure or the user gives; other names are refused."""
        return worst_named(self.structure, name, self.descriptors)

    def constraint(self, words: list[Any]) -> Constraint:
        """Constraint that `words_of` wrote."""
        name, sense, bound, *ease = words
        return Constraint(self.descriptor(name), sense, bound, *ease)


def words_of(constraint: Constraint) -> list[Any]:
    """Constraint as plain data; its ease only where it has one."""
    ease = [constraint.ease] if constraint.ease else []
    return [constraint.descriptor.name, constraint.sense, constraint.bound, *ease]
