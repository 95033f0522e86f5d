"""Numbers that the article quotes, beside the number of ours that answers each."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Quoted:
    """A number of the article.

    Parameters
    ----------
    example, key
        The example, and the key of ours among its numbers.
    what, theirs
        What is quoted, and its value.
    note
        One sentence where they differ by more than their last digit.
    """

    example: str
    key: str
    what: str
    theirs: float
    note: str = ""


_SIGN = "The article's Δ has another sign or scale; its own formulas fit neither."
_FIXED = "(0.40, 0.90) lies on another level of F than C_s."

QUOTED = (
    Quoted(
        "spring",
        "load of C_s",
        "F at C_s = (0.62, 0.80)",
        1.0,
        "F = k (1 − x_l/cos δ) sin δ is 0.0099 k there, not 1.",
    ),
    Quoted(
        "spring",
        "x_l of delta = 0.40 at the load of C_s",
        "x_l of C_t1, δ = 0.40 at the load of C_s",
        0.90,
        _FIXED,
    ),
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
        "x_l of C_t3 at the load of C_s",
        "x_l of C_t3, δ = −0.62",
        0.80,
        "(−0.62, 0.80) has the opposite load, so that it is no equilibrium at that of C_s.",
    ),
    Quoted(
        "spring",
        "routes to C_t3 at fixed load",
        "routes from C_s to C_t3 at fixed load",
        0.0,
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
        "left-half: limit load at (0.9, 0)",
        "q_lim(0.9, 0), left half",
        2.5,
        "The path turns back at 2.3639; the article's value may be rounded from it.",
    ),
    Quoted("limit_loads", "left-half: largest limit load", "largest q_lim, left half", 4.0, _SIGN),
    Quoted("limit_loads", "left-half: its Theta", "its Θ", 0.66, _SIGN),
    Quoted("limit_loads", "left-half: its Delta", "its Δ", 1.36, _SIGN),
    Quoted("curvatures", "uniform: its Theta", "Θ of the least max |κ|, uniform", 0.94),
    Quoted("curvatures", "uniform: its Delta", "its Δ", 0.0),
    Quoted("curvatures", "left-half: its Theta", "Θ of the least max |κ|, left half", 0.64),
    Quoted("curvatures", "left-half: its Delta", "its Δ", 1.16, _SIGN),
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
        "uniform: max |kappa| at (0.64, 1.16)",
        "max |κ| at (0.64, 1.16), uniform",
        11.7,
        _SIGN,
    ),
    Quoted(
        "curvatures",
        "left-half: least max |kappa|",
        "max |κ| at the optimum, left half",
        3.35,
        "The least value is lower, at a kink where three extrema of |κ| tie.",
    ),
    Quoted("inside_out", "stable equilibria at (1, 0)", "stable equilibria at (1, 0)", 2.0),
    Quoted(
        "inside_out",
        "routes within max |kappa| <= 6",
        "routes along the way-points within max |κ| ≤ 6",
        1.0,
        "The goal itself has max |κ| = 10.55, so that the limit of 6 excludes it.",
    ),
    Quoted("tracking", "square tracked", "the closed target curve can be tracked", 1.0),
    Quoted("tracking", "Delta at (0.15, 0.15)", "Δ at y(1/3) = y(2/3)", 0.0),
)
