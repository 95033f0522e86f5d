"""How many examples hypothesis draws where each of them lifts a set."""

from hypothesis import HealthCheck, Phase, settings


def few(examples: int) -> settings:
    """The same few examples in every run; none is made smaller, which would take minutes."""
    return settings(
        max_examples=examples, deadline=None, suppress_health_check=[HealthCheck.too_slow],
        derandomize=True, phases=[Phase.explicit, Phase.generate],
    )  # fmt: skip
