"""General bordered solves with the condensed factorisation."""
