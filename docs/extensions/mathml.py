"""Formulas as MathML, which browsers draw themselves: no scripts, no network."""

from docutils import nodes
from docutils.utils.math import latex2mathml
from sphinx.errors import ExtensionError


def _markup(node: nodes.Node, block: bool) -> str:
    try:
        return str(latex2mathml.tex2mathml(node.astext(), as_block=block))
    except Exception as error:
        raise ExtensionError(f"{node.source}: {node.astext()!r} is no formula: {error}") from error


def inline(writer, node):
    """Write a formula in a line."""
    writer.body.append(_markup(node, block=False))
    raise nodes.SkipNode


def block(writer, node):
    """Write a formula of its own."""
    writer.body.append(f'<div class="formula">{_markup(node, block=True)}</div>')
    raise nodes.SkipNode


def setup(app):
    """Make it the way in which formulas are drawn."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    app.config.html_math_renderer = "mathml"
    return {"parallel_read_safe": True}
