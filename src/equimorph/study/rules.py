"""Rules of a study that prefer one of the states over a point."""

from pydantic import model_validator

from equimorph import charts
from equimorph.study.fields import Positive, Section, requirement
from equimorph.study.lookup import Ground, check_parameters, descriptor_at


class RuleSection(Section):
    """Which of the states over a point is preferred; see `equimorph.reduce`."""

    highest: str | None = None
    lowest: str | None = None
    quasi_static: str | None = None
    first_stable_on_path: str | None = None
    bound: Positive | None = None

    @model_validator(mode="after")
    def _one_rule(self) -> "RuleSection":
        rules = (self.highest, self.lowest, self.quasi_static, self.first_stable_on_path)
        if sum(rule is not None for rule in rules) != 1:
            raise requirement("give one of highest, lowest, quasi_static, first_stable_on_path")
        if self.bound is not None and self.first_stable_on_path is None:
            raise requirement("give a bound of the load to first_stable_on_path only")
        return self


def rule_of(ground: Ground, section: RuleSection, key: str) -> charts.Rule:
    """Rule that a section describes.

    Raises
    ------
    InputError
        For a descriptor or parameter that the structure does not have.
    """
    if section.highest is not None:
        return charts.highest(descriptor_at(ground.structure, section.highest, f"{key}.highest"))
    if section.lowest is not None:
        return charts.lowest(descriptor_at(ground.structure, section.lowest, f"{key}.lowest"))
    if section.quasi_static is not None:
        check_parameters(ground.structure, [section.quasi_static], f"{key}.quasi_static")
        return charts.quasi_static(section.quasi_static)
    load = section.first_stable_on_path or ""
    check_parameters(ground.structure, [load], f"{key}.first_stable_on_path")
    bound = {} if section.bound is None else {"bound": section.bound}
    return charts.first_stable_on_path(load, **bound)
