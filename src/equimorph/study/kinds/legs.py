"""What kinds have in common whose targets and loads move leg by leg."""

from collections.abc import Mapping, Sequence

from equimorph.errors import InputError
from equimorph.model import Descriptor, names_of
from equimorph.structures import Structure
from equimorph.study.lookup import Ground, descriptor_at

Legs = tuple[Mapping[Descriptor | str, float], ...]


def legs_of(structure: Structure, targets: Sequence[Mapping[str, float]], key: str) -> Legs:
    """Look up legs: parameters stay names, all others are descriptors."""
    names = names_of(structure.parameters)
    return tuple(
        {
            (text if text in names else descriptor_at(structure, text, f"{key}[{i}]")): value
            for text, value in leg.items()
        }
        for i, leg in enumerate(targets)
    )


def limits_of(
    ground: Ground, actuators: Sequence[str], key: str
) -> Mapping[str, tuple[float, float]]:
    """Actuators with the sides of the box as their limits.

    Raises
    ------
    InputError
        For one that the set does not free.
    """
    box = ground.box
    sides = zip(box.names, box.lower.tolist(), box.upper.tolist(), strict=True)
    limits = {name: (low, high) for name, low, high in sides}
    unknown = [name for name in actuators if name not in limits]
    if unknown:
        raise InputError(
            f"`{key}` must be free parameters of the set ({', '.join(limits)}); "
            f"got {', '.join(unknown)}."
        )
    return {name: limits[name] for name in actuators}
