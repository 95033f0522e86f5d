"""Study files as text: TOML, with the line that is malformed."""

import re
import tomllib
from typing import Any

from equimorph.errors import InputError
from equimorph.study.complaint import cut

_PLACE = re.compile(r"(.*) \(at line (\d+), column (\d+)\)")

# How to write what was probably meant, by the beginning of what Python's parser finds.
_REMEDIES = {
    "Invalid value": "Text stands in quotes, decimals have a point, true and false no capitals.",
    "Cannot overwrite a value": "Give each key once.",
    "Cannot declare": "Begin each section once; a list has double brackets, [[route]], each time.",
    "Expected '=' after a key": "Write key = value; decimals have a point, tables { }.",
    "Expected newline": "Write one value; text stands in quotes, decimals have a point.",
    "Unclosed": "Close what this line, or one above, has opened.",
    "Unterminated": "Close the text with another quote.",
    'Expected "': "Close the text with another quote.",
    "Illegal character": "Close the text with another quote.",
}


def parse_toml(text: str, name: str) -> dict[str, Any]:
    """Read TOML.

    Parameters
    ----------
    text
        Content of a file.
    name
        Name of the file, for messages.

    Raises
    ------
    InputError
        If `text` is malformed: with the line and what stands there.
    """
    try:
        return tomllib.loads(text)
    except RecursionError as error:
        raise InputError(f"{name}: the study must not nest lists or tables so deep.") from error
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{name}: {_sentence(str(error), text)}") from error
    except ValueError as error:
        raise InputError(f"{name}: numbers must be readable; got one of many digits.") from error


def _sentence(finding: str, text: str) -> str:
    remedy = next((hint for start, hint in _REMEDIES.items() if finding.startswith(start)), "")
    place = _PLACE.fullmatch(finding)
    if place is None:
        return f"the file must be valid TOML; got an error: {finding}. {remedy}".rstrip()
    # The parser counts what \n ends.
    line = text.replace("\r\n", "\n").split("\n")[int(place[2]) - 1].strip()
    return (
        f"line {place[2]} must be valid TOML; got {cut(line) or 'nothing'} "
        f"({place[1]}, at column {place[3]}). {remedy}".rstrip()
    )
