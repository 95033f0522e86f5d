"""Maps over a grid of actuator settings."""
