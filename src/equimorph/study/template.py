"""Studies to begin with: the examples, as they are shipped."""

import json
import re
from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from equimorph.errors import InputError
from equimorph.study.schema import TITLE, schema_text

TEMPLATES = files("equimorph.study") / "templates"
KINDS = sorted(each.name[:-5] for each in TEMPLATES.iterdir() if each.name.endswith(".toml"))
"""Names of the templates."""
SCHEMA_FILE = "study.schema.json"
"""File beside a new study by which editors complete and check it."""
_SCHEMA_LINE = re.compile(r"^#:schema .*$", re.MULTILINE)


def template(kind: str) -> str:
    """Return the text of an example study; kinds without a template are refused."""
    if kind not in KINDS:
        raise InputError(f"`kind` must be one of {', '.join(KINDS)}; got {kind!r}.")
    return _template_file(f"{kind}.toml").read_text(encoding="utf-8")


def _template_file(name: str) -> Traversable:
    return TEMPLATES / name


def write_template(path: Path, kind: str) -> None:
    """Write an example study to a new file, and its data and the schema to the same folder.

    A schema of another release is replaced; a file of that name that is no schema of studies stays.
    Refused if the file exists or cannot be written, or its name does not end in ``.toml``.
    """
    if path.suffix != ".toml":
        raise InputError(f"`study file` must end in .toml; got {path.name!r}.")
    texts = {path: _SCHEMA_LINE.sub(f"#:schema {SCHEMA_FILE}", template(kind), count=1)}
    data = _template_file(f"{kind}.csv")
    if data.is_file():
        texts[path.with_name(data.name)] = data.read_text(encoding="utf-8")
    for each, text in texts.items():
        _write_new(each, text)
    schema = path.with_name(SCHEMA_FILE)
    if not schema.exists() or _is_schema(schema):
        schema.write_text(schema_text(), encoding="utf-8")


def _is_schema(path: Path) -> bool:
    """Whether a file is a schema of studies, of any release."""
    try:
        return bool(json.loads(path.read_text(encoding="utf-8"))["title"] == TITLE)
    except (OSError, ValueError, KeyError, TypeError):
        return False


def _write_new(path: Path, text: str) -> None:
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(text)
    except FileExistsError as error:
        raise InputError(f"`study file` must not exist yet; got {path}.") from error
    except OSError as error:
        raise InputError(
            f"`study file` must be a place that can be written; got {path}: {error.strerror}."
        ) from error
