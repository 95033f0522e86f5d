"""Verification of schedules: by lifting, and by bounds that hold between the states, too."""
