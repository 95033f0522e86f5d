"""Reference pages of all public names, in the groups of the stub `equimorph/__init__.pyi`."""

import inspect
import re
from functools import cached_property
from pathlib import Path

import equimorph
from equimorph import Structure

STUB = Path(equimorph.__file__).with_suffix(".pyi")
FOLDER = "reference/names"
PARTS = re.compile(r"descriptor|elevation|watched|own_descriptor|field_at|\w+_descriptor|\w+_along")
"""Methods that return descriptors for other parts of the package."""


def groups() -> dict[str, list[str]]:
    """Return the public names by the headings under which they stand in the stub."""
    found: dict[str, list[str]] = {}
    title = ""  # modules stand before the first heading
    for line in STUB.read_text(encoding="utf-8").splitlines():
        if line.startswith("# "):
            title = line[2:]
        elif (name := re.fullmatch(r" +(\w+) as \1,", line)) and title:
            found.setdefault(title, []).append(name[1])
    return found


def slug(title: str) -> str:
    """Return the name of the page of a group.

    >>> slug("Sections, materials and loads")
    'sections-materials-and-loads'
    """
    return re.sub(r"\W+", "-", title.lower())


def first_line_of(thing: object) -> str:
    """Return the first line of a docstring as Markdown."""
    line = (inspect.getdoc(thing) or "").split("\n", 1)[0]
    return with_links(line, "../references.md").replace("|", r"\|")


def with_links(text: str, references: str) -> str:
    """Return text of a docstring as Markdown, with links to publications.

    >>> with_links("as in [Feher2025]_", "references.md")
    'as in [Feher2025](references.md#feher2025)'
    """
    return re.sub(
        r"\[(\w+)\]_",
        lambda key: f"[{key[1]}]({references}#{key[1].lower()})",
        text.replace("``", "`"),
    )


def list_of(names: list[str]) -> str:
    """Return the part of a group's page that lists its names."""
    rows = [
        f"| [`{name}`](names/{name}.md) | {first_line_of(getattr(equimorph, name))} |"
        for name in names
    ]
    tree = ["```{toctree}", ":hidden:", "", *(f"names/{name}" for name in names), "```", ""]
    return "\n".join(["| name | |", "| --- | --- |", *rows, "", *tree])


def list_of_parts() -> str:
    """Return the list of what draws, stores and reads: the exports of their modules."""
    rows = []
    for module in (equimorph.plotting, equimorph.storage, equimorph.io):
        short = module.__name__.split(".")[1]
        rows += [
            f"| `em.{short}.{name}` | {first_line_of(thing)} |"
            for name, thing in sorted(vars(module).items())
            if not (name.startswith("_") or inspect.ismodule(thing))
        ]
    return "\n".join(["| name | |", "| --- | --- |", *rows, ""])


def page_of(name: str, title: str) -> str:
    """Return the page of one public name."""
    thing = getattr(equimorph, name)
    kind, options = "autofunction", []
    if inspect.isclass(thing):
        kind, options = "autoclass", [":members:"]
    if kind == "autoclass" and issubclass(thing, Structure) and thing is not Structure:
        options = [f":members: {', '.join(for_users(thing))}", ":inherited-members:"]
    lines = ["```{eval-rst}", ".. currentmodule:: equimorph", "", f".. {kind}:: {name}"]
    back = f"In [{title}](../{slug(title)}.md): with an example that uses it."
    return "\n".join([f"# {name}", "", back, "", *lines, *(f"   {o}" for o in options), "```", ""])


def for_users(structure: type) -> list[str]:
    """Return the methods of a structure that users call: its states and its descriptors.

    >>> for_users(equimorph.Spring)
    ['angle', 'height', 'natural_state']
    """
    states = [
        name for name in dir(structure) if re.fullmatch(r"(natural|planar|pinned)_states?", name)
    ]
    return sorted([*states, *descriptors_of(structure)])


def descriptors_of(structure: type) -> list[str]:
    """Return the methods of a structure that return descriptors."""
    return [
        name
        for name in dir(structure)
        if not name.startswith("_")
        and not PARTS.fullmatch(name)
        and "Descriptor" in str(_annotations(structure, name).get("return", ""))
    ]


def function(structure: type, name: str) -> object:
    """Return the function behind a method or property."""
    member = inspect.getattr_static(structure, name)
    if isinstance(member, property):
        return member.fget
    return member.func if isinstance(member, cached_property) else member


def _annotations(structure: type, name: str) -> dict[str, object]:
    return getattr(function(structure, name), "__annotations__", {})


def write(app: object) -> None:
    """Write the lists of all groups and the pages of all names."""
    folder = Path(app.srcdir) / FOLDER
    folder.mkdir(parents=True, exist_ok=True)
    write_if_new(folder.parent / "figures-and-files.inc.md", list_of_parts())
    for title, names in groups().items():
        write_if_new(folder.parent / f"{slug(title)}.inc.md", list_of(names))
        for name in names:
            write_if_new(folder / f"{name}.md", page_of(name, title))


def write_if_new(path: Path, text: str) -> None:
    """Write a generated page, unless it is there: unchanged pages are not built anew."""
    if not path.exists() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")


def setup(app: object) -> dict[str, bool]:
    """Write the pages before Sphinx looks for sources."""
    app.connect("builder-inited", write)
    return {"parallel_read_safe": True}
