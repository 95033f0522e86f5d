"""Every wrong study file gets one line: the key, the value, what is allowed."""

from pathlib import Path

import pytest

from equimorph.errors import InputError
from equimorph.study.problem import parse_study, read_study_text
from studies import refuse


def test_a_study_is_read_as_it_is_written(arch_text: str):
    study = parse_study(arch_text, "arch.toml")
    assert study.equilibrium_set.box == {"Theta": [0.2, 2.5], "Delta": [-2.0, 2.0]}
    assert study.tasks["route"][0].via == [{"Theta": 1.3}, {"Delta": 1.3}]
    assert study.tasks["route"][0].start.highest == "height(0.5)"


# What is changed in the study above, and what the one line must say.
WRONG = {
    "unknown key": (
        "intervals",
        "intervalls",
        r"`set\.intervalls` must be a key of `set` \(accuracy, box, checks, fixed, intervals, "
        r"limit, seed, tiles, within\); got intervalls\. Did you mean intervals\?",
    ),
    "unknown key of the structure": (
        'load = "uniform"',
        "lod = 1",
        r"`structure\.lod` must be a key of `structure` .*Did you mean load\?",
    ),
    "unknown key in a list": ("margin", "margn", r"`route\[0\]\.margn` .*Did you mean margin\?"),
    "unknown key of a state": ("highest", "higest", r"`route\[0\]\.start\.higest` .*highest\?"),
    "unknown section": ("[set]", "[sett]", r"`sett` must be a section of a study .*mean set\?"),
    "unknown structure": (
        '"rod"',
        '"beam"',
        r'`structure\.kind` must be one of "energy", "frame", "rod", "spatial frame", '
        r'"spatial rod", "spring", "truss"; got "beam"',
    ),
    "structure without a kind": ('kind = "rod"', "", r"`structure\.kind` .* got nothing"),
    "number as text": ("q = 2.5", 'q = "2.5"', r'`set\.fixed\.q` must be a number; got "2\.5"'),
    "number as truth": ("q = 2.5", "q = true", r"`set\.fixed\.q` must be a number; got true"),
    "number not finite": ("q = 2.5", "q = nan", r"`set\.fixed\.q` must be finite; got NaN"),
    "half intervals": ("[5, 9]", "[5, 9.5]", r"`set\.intervals\[1\]` must be a whole number"),
    "no intervals": ("[5, 9]", "[0, 9]", r"`set\.intervals\[0\]` must be at least 2"),
    "one number for a list": ("[5, 9]", "5", r"`set\.intervals` must be a list; got 5"),
    "text for a table": ("{ q = 2.5 }", '"q"', r"`set\.fixed` must be a table"),
    "reversed bounds": (
        "[0.2, 2.5]",
        "[2.5, 0.2]",
        r"`set\.box\.Theta` must be \[lower, upper\] with lower < upper; got \[2\.5, 0\.2\]",
    ),
    "one bound": ("[0.2, 2.5]", "[0.2]", r"`set\.box\.Theta` must have at least 2 entries"),
    "one free parameter less": (
        ", Delta = [-2.0, 2.0]",
        "",
        r"`set` must give one number of intervals for each parameter of its box",
    ),
    "span too long": (
        'load = "uniform"',
        "span = 1.0",
        r"in `structure`: `span` must lie between 0 and 1 \(both excluded\), the rod has length 1; "
        r"got 1\.0",
    ),
    "span too short": (
        'load = "uniform"',
        "span = 0",
        r"`structure\.span` must be greater than 0; got 0",
    ),
    "load not finite": (
        '"uniform"',
        "[[0, 1], [1, inf]]",
        r"`structure\.load` must be .* finite numbers .*; got \[\[0, 1\], \[1, Infinity\]\]",
    ),
    "load unknown": ('"uniform"', '"snow"', r'`structure\.load` must be "uniform".*got "snow"'),
    "load no table": ('"uniform"', "[1, 2]", r"`structure\.load` must be"),
    "constraint no comparison": (
        '["max_curvature <= 20"]\nintervals',
        '["max_curvature < 20"]\nintervals',
        r"`set\.within\[0\]` must read like max_curvature <= 20",
    ),
    "negative margin": ("margin = 0.1", "margin = -1", r"`route\[0\]\.margin` must be at least 0"),
    "two choices": (
        'highest = "height(0.5)"',
        'highest = "height(0.5)", lowest = "height(0.5)"',
        r"`route\[0\]\.start` must choose by one of highest, lowest, near",
    ),
    "two descriptors": (
        'highest = "height(0.5)"',
        'near = { "height(0.5)" = 1.0, "height(0.2)" = 1.0 }',
        r"`route\[0\]\.start\.near` must hold exactly one descriptor",
    ),
    "name that is a path": (
        '"inside-out"',
        '"../inside-out"',
        r"`route\[0\]\.name` must be made of letters, digits, - and _",
    ),
    "one route for a list": (
        "[[route]]",
        "[route]",
        r"`route` must be a list; .* Write \[\[route\]\]",
    ),
    "no way-points": ("via = [{ Theta = 1.3 }, { Delta = 1.3 }]", "via = []", r"`route\[0\]\.via`"),
    "malformed TOML": ("[set]", "[set", r"^arch\.toml: line 5 must be valid TOML; got \[set \("),
    "text without quotes": (
        'kind = "rod"',
        "kind = rod",
        r"line 2 must be valid TOML; got kind = rod \(.*column 8\)\. Text stands in quotes",
    ),
    "capital truth": ("margin = 0.1", "margin = True", r"got margin = True \(.*no capitals"),
    "decimal comma": ("q = 2.5 }", "q = 2,5 }", r"line 7 .*decimals have a point"),
    "quote not closed": ('"uniform"', '"uniform', r"line 3 .*got load = .uniform \(.*quote"),
    "list not closed": ("[5, 9]", "[5, 9", r"line 11 .*Close what this line, or one above"),
    "section given twice": ("[set]", "[structure]", r"line 5 .*Begin each section once"),
    "key given twice": (
        "intervals = [5, 9]",
        "intervals = [5, 9]\nintervals = [5, 9]",
        r"line 10 .*Give each key once",
    ),
    "number with a unit": (
        "[0.2, 2.5]",
        '["10 deg", 2.5]',
        r'must be a number; got "10 deg"\. Write numbers without quotes and units; angles are in r',
    ),
    "constraint not in a list": (
        'within = ["max_curvature <= 20"]\nintervals',
        'within = "max_curvature <= 20"\nintervals',
        r"`set\.within` must be a list; .*Put its entries in \[ \]",
    ),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_wrong_study_gets_one_line_with_its_key(case: str, arch_text: str):
    refuse(arch_text, *WRONG[case], name="arch.toml")


def test_the_line_begins_with_the_file(arch_text: str):
    with pytest.raises(InputError, match=r"^arch\.toml: "):
        parse_study(arch_text.replace("margin", "margn"), "arch.toml")


def test_further_mistakes_are_counted(arch_text: str):
    wrong = arch_text.replace("margin", "margn").replace("[5, 9]", "[0, 0]")
    with pytest.raises(InputError, match=r"\(2 more after this\.\)"):
        parse_study(wrong, "arch.toml")


def test_two_routes_need_two_names(arch_text: str):
    route = arch_text[arch_text.index("[[route]]") :]
    with pytest.raises(InputError, match="every route a different name"):
        parse_study(arch_text + "\n" + route, "arch.toml")


def test_a_long_value_is_cut(arch_text: str):
    table = str([[i / 99, 1.0] for i in range(100)]).replace("1.0]]", "nan]]")
    with pytest.raises(InputError) as found:
        parse_study(arch_text.replace('"uniform"', table), "arch.toml")
    assert len(str(found.value)) < 200


def test_a_missing_file_is_named(tmp_path: Path):
    with pytest.raises(InputError, match=r"none\.toml: No such file or directory"):
        read_study_text(tmp_path / "none.toml")


def test_a_mark_at_the_beginning_and_other_line_ends_do_not_count(arch_text: str, tmp_path: Path):
    """As editors on other systems leave them."""
    (tmp_path / "arch.toml").write_bytes(b"\xef\xbb\xbf" + arch_text.replace("\n", "\r\n").encode())
    text = read_study_text(tmp_path / "arch.toml")
    assert parse_study(text, "arch.toml") == parse_study(arch_text, "arch.toml")


def test_a_file_that_is_no_text_is_refused(tmp_path: Path):
    (tmp_path / "picture.toml").write_bytes(b"\x89PNG\xff\xfe")
    with pytest.raises(InputError, match="not UTF-8 text"):
        read_study_text(tmp_path / "picture.toml")
