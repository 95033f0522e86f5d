"""As many elements as states up to a bound of the curvature need.

See docs/decisions.md, "Elements for a bound of the curvature".
"""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, replace
from math import acos, ceil, prod
from typing import Annotated, ClassVar, Self

from scipy.optimize import brentq
from scipy.special import j0, jn_zeros

from equimorph.argument_checks import check_arguments
from equimorph.argument_vocabulary import POSITIVE
from equimorph.errors import InputError
from equimorph.model import Call

TAIL = 1e-3
"""Largest of the two highest Legendre coefficients of an angle in a resolved element."""

STRAIGHT = 0.999
"""Largest distance of the ends of a rod, relative to its length, for which elements are chosen."""


@dataclass(frozen=True)
class Waves:
    """Flat waves of a rod: those that need the shortest elements for their curvature.

    smallest: amplitude in radians down to which waves as curved as the bound are resolved where
    nothing is known of the ends; between: amplitude where these are a share of the length apart.
    """

    smallest: float
    between: Callable[[float], float]


def _in_plane(share: float) -> float:
    """Amplitude A of ``θ = A sin(ks)``, of which J₀(A) is the mean of cos θ."""
    return UNEVEN * float(brentq(lambda amplitude: j0(amplitude) - share, 0.0, FIRST_ZERO))


def _in_space(share: float) -> float:
    """Angle between the tangents of a helix and its axis: it is flatter than waves in a plane."""
    return UNEVEN * acos(share)


FIRST_ZERO = float(jn_zeros(0, 1)[0])
"""Of J₀."""
UNEVEN = 0.8
"""Smallest amplitude of waves along a rod, relative to that of even ones between the same ends:
where forces are larger, waves are flatter. Of arches in space it was 0.83."""
IN_PLANE, IN_SPACE = Waves(0.4, _in_plane), Waves(0.5, _in_space)
"""Of 72 states of a frame of stiff members at its bound the amplitude was 0.43 at least; of arches
in space whose span is four fifths of their length it was 0.53, as of helices, with ten half waves.
"""


def turn_of_element(degree: int, smallest_wave: float) -> float:
    """Turn κh of an element of length h by which it still resolves waves of curvature κ.

    The coefficient n of A sin(2xt), −1/2 ≤ t ≤ 1/2, in Legendre polynomials is at most
    ``A xⁿ/(2n − 1)!!``, the first term of ``A (2n + 1) jₙ(x)``; κh = 2Ax.

    `degree`: of the polynomials in an element; of its two highest coefficients the lower one is
    larger. `smallest_wave`: smallest amplitude A in radians of waves with this curvature. Returns
    the turn in radians.
    """
    n = degree - 1
    x = (TAIL * prod(range(1, 2 * n, 2)) / smallest_wave) ** (1.0 / n)
    return 2.0 * smallest_wave * float(x)


class Refinable:
    """A structure of rods whose elements can be chosen for a bound of the curvature."""

    waves: ClassVar[Waves]
    """Flat waves of its rods."""

    resolution: tuple[int, int]
    """Elements of each rod, and their degree."""

    @property
    @abstractmethod
    def longest_piece(self) -> float:
        """Length of the longest rod that is divided into elements, in the unit of length."""

    @property
    @abstractmethod
    def origin_call(self) -> Call:
        """The call that makes an equal structure."""

    @check_arguments
    def resolving(
        self,
        max_curvature: Annotated[float, POSITIVE],
        reach: Annotated[float, POSITIVE] | None = None,
    ) -> Self:
        """The same structure with elements that resolve states up to a bound of the curvature.

        Its descriptors and constraints are its own: ``fine = rod.resolving(24.0)``, and then
        ``within=[fine.max_curvature <= 24.0]``. The farther apart the ends of a rod are held, the
        flatter and shorter are its waves: where it is nearly straight, `reach` is needed, too.

        Parameters
        ----------
        max_curvature
            Bound of max |κ|, in the unit of the descriptor `max_curvature`.
        reach
            Largest distance at which the ends of a rod, or of the longest one, are held, in the
            unit of length. Without it they are up to 0.94 of the length apart in a plane, and 0.81
            in space.

        Returns
        -------
        A structure with at least as many elements, of the same degree.

        Raises
        ------
        InputError
            If the bound is not positive, or `reach` is not below the length: waves are then as
            flat as one likes, and no elements resolve all of them.
        """
        wave, longest = self.waves.smallest, self.longest_piece
        if reach is not None:
            if reach > STRAIGHT * longest:
                raise InputError(
                    f"`reach` must be at most {STRAIGHT} of the length, {longest:g}; got "
                    f"{reach!r}. Waves of a straight rod are as flat as one likes: keep its ends "
                    "nearer."
                )
            wave = min(wave, self.waves.between(reach / longest))
        call, (elements, degree) = self.origin_call, self.resolution
        needed = max(elements, ceil(max_curvature * longest / turn_of_element(degree, wave)))
        return replace(call, named={**call.named, "elements": needed})()  # type: ignore[no-any-return]
