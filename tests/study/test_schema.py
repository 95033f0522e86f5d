"""The JSON schema of studies: that of docs, right for all examples, wrong for mistakes."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest
from jsonschema import Draft202012Validator

from equimorph.study.schema import schema_text

ROOT = Path(__file__).parents[2]
SCHEMA = ROOT / "docs" / "study.schema.json"
EXAMPLES = sorted((ROOT / "examples").glob("*.toml"))


@pytest.fixture(scope="module")
def schema() -> dict[str, Any]:
    return json.loads(SCHEMA.read_text(encoding="utf-8"))


@pytest.fixture(scope="module")
def validator(schema: dict[str, Any]) -> Draft202012Validator:
    Draft202012Validator.check_schema(schema)
    return Draft202012Validator(schema)


def test_the_schema_is_that_of_the_code():
    """`python -m equimorph.study.schema > docs/study.schema.json` writes it anew."""
    assert SCHEMA.read_text(encoding="utf-8") == schema_text()


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_an_example_is_valid_and_names_the_schema(path: Path, validator: Draft202012Validator):
    text = path.read_text(encoding="utf-8")
    assert [error.message for error in validator.iter_errors(tomllib.loads(text))] == []
    assert (path.parent / text.splitlines()[0].removeprefix("#:schema ")).resolve() == SCHEMA


def test_every_key_has_a_description(schema: dict[str, Any]):
    tables = {"": schema, **schema["$defs"]}
    without = [
        (name, key)
        for name, table in tables.items()
        for key, entry in table.get("properties", {}).items()
        if not entry.get("description")
    ]
    assert without == []


def test_no_key_may_be_null(schema: dict[str, Any]):
    """TOML has no null: editors must not offer it."""
    assert '"null"' not in json.dumps(schema)
    assert 'default": null' not in json.dumps(schema)


WRONG = {
    "unknown key": ("intervals =", "intervalls =", "intervalls"),
    "unknown table": ("[[route]]", "[[rout]]", "rout"),
    "text for numbers": ("[47, 81]", '"many"', "many"),
    "unknown kind": ('"rod"', '"beam"', "beam"),
    "unknown load": ('"uniform"', '"unifrom"', "unifrom"),
    "number of no meaning": ("margin = 0.1", "margin = -1.0", "-1.0"),
}


@pytest.mark.parametrize("case", WRONG)
def test_a_mistake_is_found(case: str, validator: Draft202012Validator):
    old, new, part = WRONG[case]
    text = (ROOT / "examples" / "arch.toml").read_text()
    assert old in text
    errors = list(validator.iter_errors(tomllib.loads(text.replace(old, new, 1))))
    assert errors
    assert part in str(errors)
