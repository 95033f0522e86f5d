"""As many elements as states up to a bound of the curvature need.

See docs/decisions.md, "Elements for a bound of the curvature".
"""

from abc import abstractmethod
from dataclasses import replace
from math import ceil, prod
from typing import Annotated, ClassVar, Self

from equimorph.argument_checks import check_arguments
from equimorph.argument_vocabulary import POSITIVE
from equimorph.model import Call

TAIL = 1e-3
"""Largest of the two highest Legendre coefficients of an angle in a resolved element."""

SMALLEST_WAVE, SMALLEST_IN_SPACE = 0.4, 0.5
"""Amplitudes in radians down to which waves as curved as the bound are resolved.

Of 72 states of a frame of stiff members at its bound the amplitude was 0.43 at least; of arches in
space whose span is four fifths of their length it was 0.53, as of helices, with ten half waves.
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

    smallest_wave: ClassVar[float]
    """Smallest amplitude in radians of waves as curved as the bound that are to be resolved."""

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
    def resolving(self, max_curvature: Annotated[float, POSITIVE]) -> Self:
        """The same structure with elements that resolve states up to a bound of the curvature.

        Its descriptors and constraints are its own: ``fine = rod.resolving(24.0)``, and then
        ``within=[fine.max_curvature <= 24.0]``.

        Parameters
        ----------
        max_curvature
            Bound of max |κ|, in the unit of the descriptor `max_curvature`.

        Returns
        -------
        A structure with at least as many elements, of the same degree.

        Raises
        ------
        InputError
            If the bound is not positive.
        """
        call, (elements, degree) = self.origin_call, self.resolution
        turn = turn_of_element(degree, self.smallest_wave)
        needed = max(elements, ceil(max_curvature * self.longest_piece / turn))
        return replace(call, named={**call.named, "elements": needed})()  # type: ignore[no-any-return]
