"""Make a set finer and its cells well shaped."""
