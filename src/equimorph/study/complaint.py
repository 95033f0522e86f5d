"""One line for each mistake of a study file: which key, which value, what is allowed."""

import json
from collections.abc import Generator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

from pydantic import BaseModel, ValidationError
from pydantic_core import ErrorDetails

from equimorph.errors import InputError, suggestion


class StudyError(InputError):
    """What is wrong with a study: its text names the first mistake and counts the others.

    Parameters
    ----------
    lines
        One line for each mistake.
    """

    def __init__(self, lines: Sequence[str]) -> None:
        self.lines = tuple(dict.fromkeys(lines))
        more = f" ({len(self.lines) - 1} more after this.)" if len(self.lines) > 1 else ""
        super().__init__(f"{self.lines[0]}{more}")


class Findings:
    """Mistakes that are collected instead of raised one by one."""

    def __init__(self) -> None:
        self._lines: list[str] = []

    @contextmanager
    def collect(self) -> Generator[None]:
        """Keep the lines of an `InputError` that the block raises, and end the block there."""
        try:
            yield
        except InputError as error:
            self._lines += lines_of(error)

    def refuse(self) -> None:
        """Raise one `StudyError` of all lines, if there are any."""
        if self._lines:
            raise StudyError(self._lines)


def lines_of(error: InputError) -> Sequence[str]:
    """Return the lines of an error: all mistakes of a study, or the one that it names."""
    return error.lines if isinstance(error, StudyError) else (str(error),)


LONGEST = 60
"""Characters of a key or value in a message."""

# Requirement for each kind of finding that pydantic names; {braces} are filled from its context.
_REQUIREMENTS = {
    "missing": "be given",
    "float_type": "be a number",
    "int_type": "be a whole number",
    "string_type": "be text in quotes",
    "list_type": "be a list",
    "dict_type": "be a table of keys and values",
    "model_type": "be a table of keys and values",
    "model_attributes_type": "be a table of keys and values",
    "finite_number": "be finite",
    "greater_than": "be greater than {gt}",
    "greater_than_equal": "be at least {ge}",
    "less_than": "be less than {lt}",
    "less_than_equal": "be at most {le}",
    "literal_error": "be {expected}",
    "too_short": "have at least {min_length} entries",
    "too_long": "have at most {max_length} entries",
    "string_too_long": "have at most {max_length} characters",
    "string_pattern_mismatch": "be made of letters, digits, - and _",
}


def complaint(error: ValidationError, model: type[BaseModel], file: str) -> StudyError:
    """Describe each error that pydantic found in a study file in one line, after the file's name.

    The model is that of the whole file, which knows the allowed keys.
    """
    findings = error.errors(include_url=False)
    # A misspelt key is also a missing one: name the misspelling first.
    findings.sort(key=lambda finding: finding["type"] != "extra_forbidden")
    return StudyError([f"{file}: {_sentence(finding, model)}" for finding in findings])


def short(value: object) -> str:
    """Value as it would stand in the file, cut to a readable length."""
    try:
        text = json.dumps(value, ensure_ascii=False, default=str)
    except ValueError:
        text = "a number of thousands of digits"
    return cut(text)


def cut(text: str) -> str:
    """Text, cut to a readable length."""
    return text if len(text) <= LONGEST else text[: LONGEST - 3] + "..."


def key_path(location: tuple[int | str, ...]) -> str:
    """Join a location as it is said: ``route[0].start.at``.

    Examples
    --------
    >>> key_path(("route", 0, "start"))
    'route[0].start'
    """
    path = "".join(f"[{part}]" if isinstance(part, int) else f".{cut(part)}" for part in location)
    return path.removeprefix(".")


def _sentence(finding: ErrorDetails, model: type[BaseModel]) -> str:
    location = _as_written(finding["loc"])
    kind = finding["type"]
    if kind == "extra_forbidden":
        return _unknown_key(finding["loc"], location, model)
    if kind in ("union_tag_invalid", "union_tag_not_found"):
        return _unknown_kind(finding, location, model)
    name = f"`{key_path(location)}`" if location else "the study"
    requirement = _REQUIREMENTS.get(kind, finding["msg"])
    requirement = requirement.format_map(_Forgiving(finding.get("ctx", {})))
    got = "nothing" if kind == "missing" else short(finding["input"])
    return f"{name} must {requirement}; got {got}.{_remedy(kind, finding['input'], location)}"


def _remedy(kind: str, given: object, location: tuple[int | str, ...]) -> str:
    """How to write what was probably meant, as a sentence to end the line with."""
    if kind in ("float_type", "int_type") and isinstance(given, str):
        return " Write numbers without quotes and units; angles are in radians."
    if kind == "list_type" and len(location) == 1:
        return f" Write [[{location[0]}]] above each."
    if kind == "list_type" and not isinstance(given, dict):
        return " Put its entries in [ ]."
    return ""


def _as_written(location: tuple[int | str, ...]) -> tuple[int | str, ...]:
    """Location without the kind that pydantic puts behind the key of the structure."""
    return location[:1] + location[2:] if location[:1] == ("structure",) else location


def _unknown_kind(
    finding: ErrorDetails, location: tuple[int | str, ...], model: type[BaseModel]
) -> str:
    key = model.model_json_schema(by_alias=True)["properties"][location[-1]]
    allowed = ", ".join(f'"{kind}"' for kind in key["discriminator"]["mapping"])
    context = finding.get("ctx", {})
    got = short(context["tag"]) if "tag" in context else "nothing"
    return f"`{key_path((*location, 'kind'))}` must be one of {allowed}; got {got}."


def _unknown_key(
    loc: tuple[int | str, ...], location: tuple[int | str, ...], model: type[BaseModel]
) -> str:
    allowed = sorted(_keys_at(loc[:-1], model))
    place = key_path(location[:-1])
    where = f"a key of `{place}`" if place else "a section of a study"
    written = str(loc[-1])
    return (
        f"`{key_path(location)}` must be {where} ({', '.join(allowed)}); got {cut(written)}."
        f"{suggestion(written, allowed)}"
    )


def _keys_at(loc: tuple[int | str, ...], model: type[BaseModel]) -> list[str]:
    """Keys that a model allows at a location of the file."""
    schema = model.model_json_schema(by_alias=True)
    node: dict[str, Any] = schema
    for part in loc:
        node = _step(node, part, schema)
    return list(node.get("properties", {}))


INSIDE = {"$ref", "items", "additionalProperties"}
"""Words of a schema for what has parts."""


def _step(node: dict[str, Any], part: int | str, schema: dict[str, Any]) -> dict[str, Any]:
    """One part of a location further down in a JSON schema."""
    if isinstance(part, int):
        inner = node["items"]
    elif "discriminator" in node:
        inner = {"$ref": node["discriminator"]["mapping"][part]}
    else:
        inner = node.get("properties", {}).get(part) or node["additionalProperties"]
    for option in inner.get("anyOf", []):
        inner = option if option.keys() & INSIDE else inner
    if "$ref" in inner:
        inner = schema["$defs"][inner["$ref"].rpartition("/")[2]]
    return dict(inner)


class _Forgiving(dict[str, Any]):
    """Mapping for texts whose braces may have no value."""

    def __init__(self, context: Mapping[str, Any]) -> None:
        short = {name: f"{x:g}" for name, x in context.items() if isinstance(x, float)}
        super().__init__({**context, **short})

    def __missing__(self, key: str) -> str:
        return "{" + key + "}"
