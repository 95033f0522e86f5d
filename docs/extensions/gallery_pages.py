"""Pages of the gallery: a card and a page for each example, from its docstring, picture and output.

``python docs/extensions/gallery_pages.py [NAME ...]`` runs examples and writes the pictures and
what they print to docs/gallery; building the site only reads these.
"""

import ast
import io
import runpy
import sys
from contextlib import redirect_stdout
from pathlib import Path

from public_names import with_links, write_if_new

ROOT = Path(__file__).parents[2]
EXAMPLES = ROOT / "examples"
FOLDER = ROOT / "docs" / "gallery"
WIDTH = 800
"""Largest width of a picture in pixels."""
COLOURS = 128


def names() -> list[str]:
    """Return the examples that have a picture."""
    return sorted(path.stem for path in FOLDER.glob("*.png"))


def words(name: str) -> tuple[str, str]:
    """Return the title of an example and the rest of its docstring."""
    text = ast.get_docstring(ast.parse((EXAMPLES / f"{name}.py").read_text(encoding="utf-8")))
    title, _, rest = (text or "").partition("\n")
    told = title.rstrip("."), rest.split("Run it:")[0].strip()
    return tuple(with_links(each, "../references.md") for each in told)


def page(name: str) -> str:
    """Return the page of an example."""
    title, rest = words(name)
    lines = [f"# {title}", "", rest, "", f"![{title}]({name}.png)", ""]
    if (EXAMPLES / f"{name}.toml").exists():
        lines += [f"    equimorph run examples/{name}.toml", ""]
    lines += [f"    python examples/{name}.py", ""]
    output = FOLDER / f"{name}.txt"
    if output.exists() and output.read_text(encoding="utf-8").strip():
        lines += [
            "It prints",
            "",
            f"```{{literalinclude}} {name}.txt",
            ":language: none",
            "```",
            "",
        ]
    return "\n".join([*lines, f"```{{literalinclude}} ../../examples/{name}.py", "```", ""])


def index() -> str:
    """Return the page of cards."""
    lines = [
        "# Gallery",
        "",
        "Each card leads to the picture, the command, the Python and the results.",
        "",
    ]
    lines += ["::::{grid} 1 2 2 3", ":gutter: 3", ""]
    for name in names():
        title, _ = words(name)
        lines += [f":::{{grid-item-card}} {title}", f":link: {name}", ":link-type: doc"]
        lines += [f":img-top: {name}.png", f":img-alt: {title}", ":::", ""]
    return "\n".join([*lines, "::::", "", "```{toctree}", ":hidden:", "", *names(), "```", ""])


def write(app):
    """Write the pages of all examples with a picture."""
    write_if_new(FOLDER / "index.md", index())
    for name in names():
        write_if_new(FOLDER / f"{name}.md", page(name))


def draw(name: str) -> None:
    """Run an example; keep its picture, made small, and what it prints."""
    from PIL import Image  # noqa: PLC0415  only here

    printed = io.StringIO()
    with redirect_stdout(printed):
        runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    FOLDER.mkdir(exist_ok=True)
    (FOLDER / f"{name}.txt").write_text(printed.getvalue(), encoding="utf-8")
    with Image.open(f"{name}.png") as drawn:
        small = drawn.convert("RGB")
    small.thumbnail((WIDTH, WIDTH), Image.Resampling.LANCZOS)
    reduced = small.quantize(COLOURS, Image.Quantize.MEDIANCUT)
    reduced.save(FOLDER / f"{name}.png", optimize=True)


def setup(app):
    """Write the pages before Sphinx looks for sources."""
    app.connect("builder-inited", write)
    return {"parallel_read_safe": True}


if __name__ == "__main__":
    for each in sys.argv[1:] or sorted(path.stem for path in EXAMPLES.glob("*.py")):
        draw(each)
