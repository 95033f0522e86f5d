"""Words on the screen."""

import pytest

from equimorph.cli import check


@pytest.mark.parametrize(
    ("number", "word", "words"),
    [
        (1, "route", "1 route"),
        (2, "route", "2 routes"),
        (2, "sensitivity", "2 sensitivities"),
        (1, "sensitivity", "1 sensitivity"),
        (3, "reach", "3 reaches"),
        (2, "robustness", "2 robustness"),
    ],
)
def test_sections_are_counted_as_one_says_it(number: int, word: str, words: str):
    assert check._count(number, word) == words
