"""Questions of a study file on how sure a state is."""

from typing import Annotated, Literal

from pydantic import Field

from equimorph.study.expressions import LARGEST
from equimorph.study.sections.extent import StateSection
from equimorph.study.sections.fields import ComparisonText, TaskSection

Positive = Annotated[float, Field(gt=0, le=LARGEST)]


class SensitivitySection(TaskSection):
    """Derivatives of descriptors at a state; see `equimorph.sensitivity`."""

    state: StateSection
    descriptors: list[str] = Field(min_length=1)
    parameters: list[str] | None = Field(default=None, min_length=1)


class ImperfectionSection(TaskSection):
    """How limit loads change with imperfections; see `equimorph.imperfection_law`."""

    state: StateSection
    load: str
    imperfections: list[str] = Field(min_length=1)
    within: list[ComparisonText] = Field(default_factory=list)


class RoomSection(TaskSection):
    """How far parameters may stray from a state; see `equimorph.stable_room`."""

    state: StateSection
    tolerances: dict[str, Positive] = Field(min_length=1)
    shape: Literal["box", "ellipsoid"] = "box"
    most: Positive = 100.0
    within: list[ComparisonText] = Field(default_factory=list)


class SnapSection(TaskSection):
    """The least change of parameters to a snap; see `equimorph.least_snap`."""

    state: StateSection
