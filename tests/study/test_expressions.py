import pytest
from hypothesis import given, strategies as st

from equimorph.errors import InputError
from equimorph.structures import Rod
from equimorph.study.fields import parse_comparison

NUMBERS = st.floats(-1e9, 1e9)


@given(
    name=st.sampled_from(["max_curvature", "height(1/3)", "support_force(mu)"]),
    sense=st.sampled_from(["<=", ">="]),
    bound=NUMBERS,
    gap=st.sampled_from(["", " ", "  "]),
)
def test_a_comparison_is_read_as_it_is_written(name: str, sense: str, bound: float, gap: str):
    found = parse_comparison(f"{gap}{name}{gap}{sense}{gap}{bound!r}{gap}")
    assert (found.descriptor, found.sense, found.bound) == (name, sense, bound)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "<= 3",
        "height(0.5) <=",
        "a <= b",
        "a < 1",
        "1 <= a <= 2",
        "a <= 1e",
        "a == 1",
        "a <= 1e999",
    ],
)
def test_other_forms_are_refused(text: str):
    with pytest.raises(InputError, match="must read like"):
        parse_comparison(text)


def test_a_comparison_on_a_structure_is_the_constraint_of_the_library():
    arch = Rod()
    assert str(parse_comparison("max_curvature<=6").on(arch)) == str(arch.max_curvature <= 6)


@pytest.mark.parametrize("sense", ["<=", ">="])
def test_bounds_are_as_large_as_numbers_of_studies(sense: str):
    assert parse_comparison(f"a {sense} -1e9").bound == -1e9
    with pytest.raises(InputError, match=r"with a number up to 1e\+09; got"):
        parse_comparison(f"a {sense} 1.000001e9")
