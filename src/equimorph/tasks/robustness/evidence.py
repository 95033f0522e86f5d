"""What is shown of the survival of a schedule under errors."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from scipy.special import betaincinv

from equimorph.arrays import Float, Shaped
from equimorph.tasks.robustness.error_model import Errors, Offsets
from equimorph.tasks.verification.tube import TubeProof

CONFIDENCE = 0.95
"""Of the lower bound on the probability to survive."""

Status = Literal["proved", "supported", "probable", "unproved", "refuted"]


@dataclass(frozen=True, eq=False)
class Survival:
    """Whether a schedule survives errors.

    Parameters
    ----------
    status
        "proved": every state is stable for all errors of the box, and there are no constraints;
        "supported": the same by bounds that are sampled, or with constraints, which are judged by
        values in each cell of the proof; "probable": the lower bound on the probability reaches
        what was asked; "unproved": neither shown nor refuted; "refuted": a trial failed (of a box),
        or the bound falls short (of a probability).
    why
        Reason for a status that is none of the first three, with the place and the errors.
    errors
        The errors.
    offsets, kind, at
        Errors tried, and how each trial ended and where; see `Trials`. Of a box corners, middles of
        its sides, and random ones, which can only refute.
    proof
        Of a box: what is known of all its errors.
    """

    status: Status
    why: str
    errors: Errors
    offsets: Offsets
    kind: Shaped[np.ndarray, " trials"]
    at: Float[np.ndarray, " trials"]
    proof: TubeProof | None = None

    def __repr__(self) -> str:
        """Status, and what it rests on."""
        if self.why:
            return f"Survival({self.status}: {self.why})"
        if self.proof is not None:
            return f"Survival({self.status} for {self.errors}: {self.proof})"
        return f"Survival({self.status}: {self.statement})"

    @property
    def survives(self) -> bool:
        """Whether it does, by the kind of evidence that was asked for."""
        return self.status in ("proved", "supported", "probable")

    @property
    def survivors(self) -> int:
        """Number of trials that arrived."""
        return int((self.kind == "arrived").sum())

    @property
    def probability(self) -> float:
        """Lower bound of 95 % confidence on the probability to survive [ClopperPearson1934]_.

        Not a number for boxes, whose trials are not random.
        """
        if self.errors.probability is None:
            return np.nan
        n, k = len(self.kind), self.survivors
        return float(betaincinv(k, n - k + 1, 1.0 - CONFIDENCE)) if k else 0.0

    @property
    def most_probable(self) -> float:
        """Upper bound of 95 % confidence on it."""
        n, k = len(self.kind), self.survivors
        return float(betaincinv(k + 1, n - k, CONFIDENCE)) if k < n else 1.0

    @property
    def statement(self) -> str:
        """Trials, survivors and what follows for the probability, in words."""
        if self.errors.probability is None:
            return f"{self.survivors} of {len(self.kind)} trials in corners and inside arrived"
        return (
            f"{self.survivors} of {len(self.kind)} random trials arrived; with 95 % confidence the "
            f"probability is at least {self.probability:.4g}"
        )
