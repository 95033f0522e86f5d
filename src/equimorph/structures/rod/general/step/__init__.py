"""Fused Newton step of general rods."""
