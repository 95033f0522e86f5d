"""Unknown parameters, offsets and gains of structures from measured states."""
