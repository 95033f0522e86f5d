"""Questions to a set: levels, locations, distances, components, snaps and cusps."""
