"""Multistable structures: the words of their stable states, and which lead to which."""
