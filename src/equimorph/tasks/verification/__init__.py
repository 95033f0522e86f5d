"""Verification of schedules: by lifting, and by bounds that hold between the states, too."""

from equimorph.tasks.verification.proof import Proof, prove
from equimorph.tasks.verification.schedule_check import Verification, first_state, verify

__all__ = ["Proof", "Verification", "first_state", "prove", "verify"]
