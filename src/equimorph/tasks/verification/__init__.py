"""Verification of schedules: by lifting, and by bounds that hold between the states, too."""

from equimorph.tasks.verification.checking import Verification, first_state, verify
from equimorph.tasks.verification.proof import Proof, prove

__all__ = ["Proof", "Verification", "first_state", "prove", "verify"]
