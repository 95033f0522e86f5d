"""Sections of a study file: what may be written, checked before anything is computed."""
