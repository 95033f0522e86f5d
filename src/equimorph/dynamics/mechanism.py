"""Rigid bodies with elastic joints: what all chains have in common."""

from abc import ABC, abstractmethod
from functools import cached_property

import numpy as np

from equimorph.arrays import Bool, Float

Vector = Float[np.ndarray, " entries"]
Pulls = Float[np.ndarray, " pulls"]
"""Multipliers: forces, and in space couples, at which loops are closed."""
Settings = Float[np.ndarray, " settings"]
"""Parameters of the structure and 1: tables times it are affine functions of the parameters."""

LIGHT = 0.1
"""Mass of a node that moves relative to that of a link; MuJoCo closes loops less sharply at lighter
bodies (by 8e-4 of the length at 1e-3)."""


class Mechanism(ABC):
    """Bodies whose configuration is a vector v of entries, some of which are prescribed.

    With the potential U and the closures c(v) = 0 of loops, ``F = (∂(U + λ·c)/∂v, c)``.
    """

    @property
    @abstractmethod
    def size(self) -> int:
        """Number of entries."""

    @property
    @abstractmethod
    def closures(self) -> int:
        """Number of conditions that close loops."""

    @cached_property
    @abstractmethod
    def free(self) -> Bool[np.ndarray, " entries"]:
        """Entries that are unknown; the others are prescribed."""

    @cached_property
    @abstractmethod
    def targets(self) -> Float[np.ndarray, "entries settings"]:
        """Values of prescribed entries, and where springs of single entries are at rest."""

    @cached_property
    @abstractmethod
    def stiffness(self) -> Float[np.ndarray, "entries entries"]:
        """Of the elastic joints, without loads."""

    @abstractmethod
    def places(self, v: Vector) -> Float[np.ndarray, "members joints space"]:
        """Places of the joints between links, ends included, of each member."""

    @abstractmethod
    def closure(self, v: Vector) -> Float[np.ndarray, "..."]:
        """By how much loops are open."""

    @abstractmethod
    def residual(self, v: Vector, multipliers: Pulls, y: Settings) -> Float[np.ndarray, " all"]:
        """F over all entries and closures."""

    @abstractmethod
    def jacobian(self, v: Vector, multipliers: Pulls, y: Settings) -> Float[np.ndarray, "all all"]:
        """Derivative of the residual."""

    @abstractmethod
    def mass(self, v: Vector) -> Float[np.ndarray, "entries entries"]:
        """Mass matrix of links with uniform density, in all entries."""

    @abstractmethod
    def potential(self, v: Vector, y: Settings) -> float:
        """Energy of elastic joints and loads."""

    def prescribe(self, v: Vector, y: Settings) -> Vector:
        """The entries with the prescribed ones set."""
        return np.asarray(np.where(self.free, v, self.targets @ y))

    @cached_property
    def unknown(self) -> Bool[np.ndarray, " all"]:
        """Free entries and all multipliers."""
        return np.concatenate([self.free, np.ones(self.closures, bool)])
