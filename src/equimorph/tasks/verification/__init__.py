"""Verification of schedules: by lifting, and by bounds that hold between the states, too."""

from equimorph.tasks.verification.proof import Proof, ProofStatus, prove
from equimorph.tasks.verification.schedule_check import Verification, first_state, verify

__all__ = ["Proof", "ProofStatus", "Verification", "first_state", "prove", "verify"]
