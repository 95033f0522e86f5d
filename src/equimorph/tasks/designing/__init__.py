"""Structures chosen so that a task becomes possible or better."""
