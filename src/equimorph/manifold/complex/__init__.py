"""What an equilibrium set is: vertices, cells, marked facets, strata and its audit; cuts of it."""
