"""Questions of a study file on how sure a state is."""

from typing import Annotated, Literal

from pydantic import Field

from equimorph.study.expressions import LARGEST
from equimorph.study.sections.extent import StateSection
from equimorph.study.sections.fields import ComparisonText, TaskSection

Positive = Annotated[float, Field(gt=0, le=LARGEST)]


class OfStateSection(TaskSection):
    """A question about one state."""

    state: StateSection


class SensitivitySection(OfStateSection):
    """Derivatives of descriptors at a state; see `equimorph.sensitivity`."""

    descriptors: list[str] = Field(min_length=1)
    parameters: list[str] | None = Field(default=None, min_length=1)


class ImperfectionSection(OfStateSection):
    """How limit loads change with imperfections; see `equimorph.imperfection_law`."""

    load: str
    imperfections: list[str] = Field(min_length=1)
    within: list[ComparisonText] = Field(default_factory=list)


class RoomSection(OfStateSection):
    """How far parameters may stray from a state; see `equimorph.stable_room`."""

    tolerances: dict[str, Positive] = Field(min_length=1)
    shape: Literal["box", "ellipsoid"] = "box"
    most: Positive = 100.0
    within: list[ComparisonText] = Field(default_factory=list)


class SnapSection(OfStateSection):
    """The least change of parameters to a snap; see `equimorph.least_snap`."""


class SnapGraphSection(TaskSection):
    """Where snaps lead from all of the stability boundary; see `equimorph.snap_graph`."""

    samples: int = Field(default=9, ge=2, le=1000)
    descriptor: str | None = None
