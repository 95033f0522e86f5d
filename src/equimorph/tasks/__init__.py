"""Shape-control tasks."""
