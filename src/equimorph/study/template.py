"""Studies to begin with: the examples, as they are shipped."""

from importlib.resources import files
from importlib.resources.abc import Traversable
from pathlib import Path

from equimorph.errors import InputError

TEMPLATES = files("equimorph.study") / "templates"
KINDS = sorted(each.name[:-5] for each in TEMPLATES.iterdir() if each.name.endswith(".toml"))
"""Names of the templates."""


def template(kind: str) -> str:
    """Return the text of an example study.

    Raises
    ------
    InputError
        If there is no template of this kind.
    """
    if kind not in KINDS:
        raise InputError(f"`kind` must be one of {', '.join(KINDS)}; got {kind!r}.")
    return _template_file(f"{kind}.toml").read_text(encoding="utf-8")


def _template_file(name: str) -> Traversable:
    return TEMPLATES / name


def write_template(path: Path, kind: str) -> None:
    """Write an example study to a new file, and its data to the same folder.

    Raises
    ------
    InputError
        If the file exists or cannot be written, or its name does not end in ``.toml``.
    """
    if path.suffix != ".toml":
        raise InputError(f"`study file` must end in .toml; got {path.name!r}.")
    texts = {path: template(kind)}
    data = _template_file(f"{kind}.csv")
    if data.is_file():
        texts[path.with_name(data.name)] = data.read_text(encoding="utf-8")
    for each, text in texts.items():
        _write_new(each, text)


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
