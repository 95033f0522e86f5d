"""The metric, simplices and their topology, tangent spaces, and exact points with conditions."""
