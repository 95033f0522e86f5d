"""Numbers that the article quotes, each with the number that reproduces it."""

import csv
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Quoted:
    """A number of the article.

    Parameters
    ----------
    example, key
        The example, and the key of ours among its numbers.
    what, theirs
        What is quoted, and its value; True or False where the article says yes or no.
    note
        One sentence where they differ by more than their last digit.
    """

    example: str
    key: str
    what: str
    theirs: float
    note: str = ""


@dataclass(frozen=True)
class QuotedTable:
    """A table of the article, ours in brackets.

    Parameters
    ----------
    example, caption, head
        The example, what the table shows, and its column titles.
    rows
        The label of each row, and for each cell theirs and the key of ours.
    """

    example: str
    caption: str
    head: tuple[str, ...]
    rows: tuple[tuple[str, tuple[tuple[str, str], ...]], ...]


CONVENTION = (
    "The article's arch hangs down and its loads are negative, or it stands and they are positive; "
    "here it stands (Θ > 0) and loads press down (q > 0), which is the mirror image y → −y. "
    "Lengths are in units of L, loads of 4π²B/L², curvatures of 1/L; ν = sin 1."
)


def _value(text: str) -> float:
    return text == "yes" if text in ("yes", "no") else float(text)


def _read(path: Path) -> tuple[Quoted, ...]:
    """Rows of a table of quoted numbers."""
    with path.open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    return tuple(
        Quoted(each["example"], each["key"], each["what"], _value(each["theirs"]), each["note"])
        for each in rows
    )


QUOTED = _read(Path(__file__).with_suffix(".csv"))

TABLES = (
    QuotedTable(
        "curvatures",
        "Largest curvatures at q = 2.5 for two loads and the actuators' settings: the article's, "
        "and in brackets ours. The article's Δ counts twice elsewhere (see the limit load at "
        "(0.9, 0.04)), and half of 1.16 is 0.58: there both loads agree with it best, 11.39 and "
        "3.76 against 11.7 and 3.35. The last two rows are the optima that are found here.",
        ("Θ, Δ", "uniform load", "left-half load"),
        (
            *(
                (
                    f"{theta:g}, {delta:g}".replace("-", "−"),
                    tuple(
                        (theirs, f"{load}: max |kappa| at ({theta:g}, {delta:g})")
                        for load, theirs in zip(("uniform", "left-half"), printed, strict=True)
                    ),
                )
                for theta, delta, printed in (
                    (0.96, 0.0, ("2.1", "7.6")),
                    (0.64, 1.16, ("11.7", "3.35")),
                    (0.64, -1.16, ("", "")),
                    (0.64, 0.58, ("", "")),
                    (0.64, -0.58, ("", "")),
                )
            ),
            (
                "0.936, 0",
                (
                    ("", "uniform: least max |kappa|"),
                    ("", "uniform: max |kappa| there under the other load"),
                ),
            ),
            (
                "0.647, 0.517",
                (
                    ("", "left-half: max |kappa| there under the other load"),
                    ("", "left-half: least max |kappa|"),
                ),
            ),
        ),
    ),
)
