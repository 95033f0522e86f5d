"""Numbers that the article quotes, each with the number that reproduces it."""

from dataclasses import dataclass


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

_SIGN = "The article's Δ has another sign or scale; its formulas fit neither."
_NO_ONE = "F = k (1 − x_l/cos δ) sin δ is {} k there, not 1."
_FIXED = "(0.40, 0.90) lies on the level 0.0089 k, C_s on 0.0099 k."

QUOTED = (
    Quoted("parameterisations", "(d) charts", "charts of the dissection in panel (d)", 3.0),
    Quoted("parameterisations", "(c) barriers", "barriers of the reduction in panel (c)", 1.0),
    Quoted("spring", "free parameters of the set", "d of the set over x_l and F", 2.0),
    Quoted("spring", "x_l of the cusp", "x_l beyond which all states are stable", 1.0),
    Quoted("spring", "load of C_s", "F at C_s = (0.62, 0.80)", 1.0, _NO_ONE.format(0.0099)),
    Quoted(
        "spring", "load of (0.40, 0.90)", "F at C_t1 = (0.40, 0.90)", 1.0, _NO_ONE.format(0.0089)
    ),
    Quoted(
        "spring",
        "x_l of delta = 0.40 at the load of C_s",
        "x_l of C_t1, δ = 0.40 at the load of C_s",
        0.90,
        _FIXED,
    ),
    Quoted("spring", "a route to C_t1 at fixed load", "a route to δ = 0.40 at fixed load", True),
    Quoted(
        "spring",
        "delta of C_t2",
        "smallest δ on the level of C_s",
        0.30,
        "The article's (0.30, 0.925) is stable, not on the stability boundary x_l = cos³δ.",
    ),
    Quoted(
        "spring",
        "x_l of C_t2",
        "x_l there",
        0.925,
        "The level of C_s meets the stability boundary at 0.93161.",
    ),
    Quoted(
        "spring",
        "margin of (0.30, 0.925)",
        "margin of (0.30, 0.925), called the stability boundary",
        0.0,
        "E'' = k x_l (x_l − cos³δ)/cos⁴δ is positive there.",
    ),
    Quoted(
        "spring",
        "x_l of C_t3 at the load of C_s",
        "x_l of C_t3, δ = −0.62",
        0.80,
        "(−0.62, 0.80) has the opposite load, so that it is no equilibrium at that of C_s.",
    ),
    Quoted(
        "spring", "a route to C_t3 at fixed load", "a route from C_s to C_t3 at fixed load", False
    ),
    Quoted(
        "spring",
        "a route to C_t3 with the load free",
        "the same with the load free, as asked",
        True,
    ),
    Quoted("limit_loads", "uniform: limit load at (0.9, 0)", "q_lim(0.9, 0), uniform", 4.2),
    Quoted(
        "limit_loads",
        "uniform: limit load at (0.9, 0.04)",
        "q_lim(0.9, 0.04), uniform",
        3.9,
        "The article's value is ours at Δ = 0.02 (3.9485): its Δ counts twice.",
    ),
    Quoted(
        "limit_loads",
        "uniform: largest limit load",
        "largest q_lim, uniform",
        4.2,
        "The ridge Δ = 0 is flat: 4.2440 at Θ = 0.9, 4.2650 at its top.",
    ),
    Quoted(
        "limit_loads",
        "uniform: its Theta",
        "its Θ",
        0.9,
        "Between 0.9 and 0.985 the limit load changes by half a per cent.",
    ),
    Quoted("limit_loads", "uniform: its Delta", "its Δ", 0.0),
    Quoted(
        "limit_loads",
        "uniform: lambda there",
        "bound of λ that a lateral load can exceed",
        1.0,
        "λ at the limit load of (0.9, 0): stable states beyond λ = 1, as the article expects.",
    ),
    Quoted(
        "limit_loads",
        "left-half: limit load at (0.9, 0)",
        "q_lim(0.9, 0), left half",
        2.5,
        "The path turns back at 2.3639, where max |κ| is 7.69: C2 is not met before.",
    ),
    Quoted(
        "limit_loads",
        "left-half: largest limit load",
        "largest q_lim, left half",
        4.0,
        "Equal to the article's two digits, at another place.",
    ),
    Quoted("limit_loads", "left-half: its Theta", "its Θ", 0.66, _SIGN),
    Quoted("limit_loads", "left-half: its Delta", "its Δ", 1.36, _SIGN),
    Quoted("curvatures", "uniform: max |kappa| at (0.96, 0)", "max |κ| at (0.96, 0), uniform", 2.1),
    Quoted(
        "curvatures",
        "left-half: max |kappa| at (0.96, 0)",
        "max |κ| at (0.96, 0), left half",
        7.6,
        "The path folds at q = 2.4239 with max |κ| = 7.97, before 2.5; the state reached beyond "
        "the snap has 14.18.",
    ),
    Quoted(
        "curvatures",
        "left-half: snaps on the way to (0.96, 0)",
        "an unstable segment on the way there",
        True,
    ),
    Quoted(
        "curvatures",
        "uniform: max |kappa| at (0.64, 1.16)",
        "max |κ| at (0.64, 1.16), uniform",
        11.7,
        _SIGN,
    ),
    Quoted(
        "curvatures",
        "left-half: max |kappa| at (0.64, 1.16)",
        "max |κ| at (0.64, 1.16), left half",
        3.35,
        "At Δ = ±1.16 ours are 14.49 and 12.81, at half of it, Δ = 0.58, 3.76.",
    ),
    Quoted("curvatures", "uniform: its Theta", "Θ of the least max |κ|, uniform", 0.94),
    Quoted("curvatures", "uniform: its Delta", "its Δ", 0.0),
    Quoted("curvatures", "left-half: its Theta", "Θ of the least max |κ|, left half", 0.64),
    Quoted("curvatures", "left-half: its Delta", "its Δ", 1.16, _SIGN),
    Quoted(
        "curvatures",
        "left-half: least max |kappa|",
        "max |κ| at the optimum, left half",
        3.35,
        "The least value is lower, at a kink where three extrema of |κ| tie.",
    ),
    Quoted(
        "curvatures",
        "uniform: factor",
        "increase on changing to the left-half load",
        3.6,
        "Theirs is 7.6 by 2.1, before the snap; ours is what the snap leads to.",
    ),
    Quoted(
        "curvatures",
        "left-half: factor",
        "increase on changing to the uniform load",
        3.5,
        "Theirs is 11.7 by 3.35; the optima are different ones.",
    ),
    Quoted("tracking", "square tracked", "the closed target curve can be tracked", True),
    Quoted(
        "tracking",
        "most stable states at a corner",
        "solutions of the inverse problem, at most",
        1.0,
        "(0.20, 0.20) is also taken at (0.4846, 0), in another region, beyond det J_S = 0.",
    ),
    Quoted("tracking", "Delta at (0.15, 0.15)", "Δ at y(1/3) = y(2/3)", 0.0),
    Quoted("tracking", "kinds of boundary of the reachable set", "kinds of its boundary", 3.0),
    Quoted(
        "tracking",
        "sides of the box on its boundary",
        "sides of the box on its boundary",
        3.0,
        "Besides Θ = 2.5 and Δ = ±2 also Θ = 0.2, at which the article's box may not end.",
    ),
    Quoted("inside_out", "stable equilibria at (1, 0)", "stable equilibria at (1, 0)", 2.0),
    Quoted("inside_out", "a route along the way-points", "stable along the way-points", True),
    Quoted(
        "inside_out",
        "supports that pull on the inverted arch",
        "the supports pull on the inverted arch (tension)",
        True,
        "λ = 1.04 there: the supports push, and the thrust is the same all along the arch.",
    ),
    Quoted(
        "inside_out",
        "a route within max |kappa| <= 6",
        "a route along the way-points within max |κ| ≤ 6",
        True,
        "The goal itself has max |κ| = 10.55, so that the limit of 6 excludes it.",
    ),
)

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
