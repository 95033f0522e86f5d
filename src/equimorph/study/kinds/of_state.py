"""What kinds have in common that ask about one state of the set."""

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Generic, TypeVar

from equimorph.manifold import EquilibriumSet
from equimorph.model import Constraint
from equimorph.structures import State
from equimorph.study.choose import choose_state
from equimorph.study.lookup import Ground, check_parameters, check_state, constraints_of
from equimorph.study.sections.robustness import OfStateSection

S = TypeVar("S", bound=OfStateSection)


@dataclass(frozen=True)
class OfState(Generic[S]):
    """A question about a state, with its constraints as objects."""

    key: str
    section: S
    constraints: tuple[Constraint, ...]

    def state(self, eset: EquilibriumSet | None) -> State:
        """Return the state that it is about."""
        assert eset is not None
        return choose_state(eset, self.section.state, f"{self.key}.state")


def of_state(ground: Ground, section: S, key: str, **parameters: Iterable[str]) -> OfState[S]:
    """Look up the state, its constraints, and the parameters that keys of the section name.

    Raises
    ------
    InputError
        For a point outside the box, or names that the structure does not have.
    """
    check_state(ground, section.state, f"{key}.state")
    for inner, names in parameters.items():
        check_parameters(ground.structure, names, f"{key}.{inner}")
    texts = getattr(section, "within", ())
    return OfState(key, section, constraints_of(ground.structure, texts, f"{key}.within"))
