"""Forms of values that a structure of a study takes: quantities, profiles, ends, terms, sections.

Each is checked here as far as its form goes; names and units are known to the structure. The JSON
schema beside each check is what editors are told.
"""

from collections.abc import Iterable
from typing import Annotated, Any

from pydantic import AfterValidator, Field, WithJsonSchema

from equimorph.structures.rod.ends import WORDS as ENDS
from equimorph.structures.rod.sections import SECTIONS
from equimorph.structures.rod.terms import TERMS
from equimorph.structures.spatial.ends import WORDS as SPATIAL_ENDS
from equimorph.study.fields import LARGEST, is_number, is_table, requirement

PLANAR_KEYS = ("angle", "x", "y", "slide")
"""Keys of an end of a rod in the plane."""
SPATIAL_KEYS = ("rotation", "x", "y", "z")
"""Keys of an end of a rod in space."""


def _load(shape: Any) -> Any:
    """Check a load shape; one requirement for all forms makes one readable line."""
    if shape not in ("uniform", "left-half") and not is_table(shape):
        raise requirement(
            'be "uniform", "left-half" or a table [[s, Q], ...] of finite numbers '
            f"up to {LARGEST:g}"
        )
    return shape


def _profile(shape: Any) -> Any:
    if not (is_number(shape) or is_table(shape) or isinstance(shape, str)):
        raise requirement(
            f"be a number up to {LARGEST:g}, a table [[s, f], ...] of such, or a text with its unit"
        )
    return shape


def _end(given: Any) -> Any:
    return _end_of(given, PLANAR_KEYS)


def _end_in_space(given: Any) -> Any:
    return _end_of(given, SPATIAL_KEYS)


def _end_of(given: Any, keys: tuple[str, ...]) -> Any:
    table = isinstance(given, dict) and set(given) <= set(keys)
    parts = given.values() if table else [given]
    if not all(isinstance(part, str) or (table and is_number(part)) for part in parts):
        example = f'{{ {keys[0]} = "free", x = "held", y = 2.0 }}'
        raise requirement(f'be a word like "clamped", or a table like {example}')
    return given


def _terms(given: Any) -> Any:
    """Check that terms are data of numbers, texts and lists; the rod itself knows their keys."""

    def plain(value: Any) -> bool:
        if isinstance(value, list):
            return all(map(plain, value))
        return isinstance(value, str) or is_number(value)

    for term in given if isinstance(given, list) else [given]:
        if not (isinstance(term, dict) and all(map(plain, term.values()))):
            raise requirement(
                'be a table like { term = "point force", s = 0.5 }, or a list of such tables, of '
                f"texts and numbers up to {LARGEST:g}"
            )
    return given


def _formula(given: Any) -> Any:
    if not (isinstance(given, str) or (type(given) in (int, float) and abs(given) <= LARGEST)):
        raise requirement(f"be a formula in quotes, or a finite number up to {LARGEST:g}")
    return given


def _quantity(given: Any) -> Any:
    """Check its form; whether a unit fits is known to the structure."""
    if not (is_number(given) or isinstance(given, str)):
        raise requirement(f'be a number up to {LARGEST:g}, or a text with its unit like "2 N m^2"')
    return given


def _stiff(given: Any) -> Any:
    if is_number(given) and not given > 0:
        raise requirement("be greater than 0")
    return _quantity(given)


def _section(given: Any) -> Any:
    """Check the form of a cross-section; the rod itself knows its keys."""
    plain = isinstance(given, dict) and all(
        isinstance(value, str) or is_number(value) for value in given.values()
    )
    if not (plain and isinstance(given.get("kind"), str)):
        raise requirement(
            'be a table like { kind = "strip", width = "20 mm", thickness = "0.5 mm", '
            'E = "210 GPa", nu = 0.3 }'
        )
    return given


def _support(given: Any) -> Any:
    table = given if isinstance(given, dict) else {}
    fine = table and all(isinstance(value, str) or is_number(value) for value in table.values())
    if not (isinstance(given, str) or fine):
        raise requirement(
            'be "fixed", "pinned", axes to hold like "y", or a table like '
            '{ x = "held", angle = 2.0 }'
        )
    return given


def _support_in_space(given: Any) -> Any:
    table = given if isinstance(given, dict) else {}
    fine = table and all(isinstance(x, str | list) or is_number(x) for x in table.values())
    if not (isinstance(given, str) or fine):
        raise requirement(
            'be "fixed", "pinned", axes to hold like "xz", or a table like '
            '{ line = [1, 0, 0], rotation = "held" }'
        )
    return given


_NUMBER = {"type": "number", "minimum": -LARGEST, "maximum": LARGEST}
_TEXT = {"type": "string"}
_ROW = {"type": "array", "items": _NUMBER, "minItems": 2, "maxItems": 2}
_TABLE = {"type": "array", "items": _ROW, "minItems": 2}
_NUMBER_OR_TEXT = {"anyOf": [_NUMBER, _TEXT]}
_WORDS = {"type": "object", "additionalProperties": _NUMBER_OR_TEXT}
_ONE_TERM = {"type": "object", "properties": {"term": {"enum": list(TERMS)}}, "required": ["term"]}
_ONE_OR_MORE_TERMS = {"anyOf": [_ONE_TERM, {"type": "array", "items": _ONE_TERM}]}
_SECTION = {**_WORDS, "properties": {"kind": {"enum": list(SECTIONS)}}, "required": ["kind"]}


def _end_form(words: Iterable[str], keys: Iterable[str]) -> WithJsonSchema:
    table = {"properties": dict.fromkeys(keys, _NUMBER_OR_TEXT), "additionalProperties": False}
    return WithJsonSchema({"anyOf": [{"enum": list(words)}, {"type": "object", **table}]})


LoadShape = Annotated[
    Any,
    AfterValidator(_load),
    WithJsonSchema({"anyOf": [{"enum": ["uniform", "left-half"]}, _TABLE]}),
]
Formula = Annotated[Any, AfterValidator(_formula), WithJsonSchema(_NUMBER_OR_TEXT)]
Quantity = Annotated[Any, AfterValidator(_quantity), WithJsonSchema(_NUMBER_OR_TEXT)]
Stiffness = Annotated[Any, AfterValidator(_stiff), WithJsonSchema(_NUMBER_OR_TEXT)]
UnitSystem = Annotated[dict[str, str], Field(min_length=2, max_length=2)]
Profile = Annotated[
    Any, AfterValidator(_profile), WithJsonSchema({"anyOf": [_NUMBER, _TEXT, _TABLE]})
]
Term = Annotated[Any, AfterValidator(_terms), WithJsonSchema(_ONE_OR_MORE_TERMS)]
CrossSection = Annotated[Any, AfterValidator(_section), WithJsonSchema(_SECTION)]
EndOfRod = Annotated[Any, AfterValidator(_end), _end_form(ENDS, PLANAR_KEYS)]
EndInSpace = Annotated[Any, AfterValidator(_end_in_space), _end_form(SPATIAL_ENDS, SPATIAL_KEYS)]
Support = Annotated[Any, AfterValidator(_support)]
SupportInSpace = Annotated[Any, AfterValidator(_support_in_space)]
