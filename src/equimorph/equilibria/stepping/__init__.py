"""From step to step: start, length and prediction."""
