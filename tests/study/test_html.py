"""Pieces of the page: what a user writes shows as it was written."""

from html.parser import HTMLParser

import pytest
from PIL import Image

from equimorph.study import html

NAME = 'stiff <b>rod</b> & "spring"'


class Seen(HTMLParser):
    """Elements of a page with their attributes, and the text inside each."""

    def __init__(self, page: str) -> None:
        super().__init__()
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: dict[str, str] = {}
        self._open: list[str] = []
        self.feed(page)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        self._open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        while self._open and self._open.pop() != tag:
            pass

    def handle_data(self, data: str) -> None:
        for tag in self._open:
            self.texts[tag] = self.texts.get(tag, "") + data


def test_titles_and_refusals_show_as_they_were_written():
    seen = Seen(html.page(NAME, [html.refusal_line(NAME)]))
    assert seen.texts["title"] == NAME
    assert seen.texts["p"] == f"Refused. {NAME}"
    assert "b" not in [tag for tag, _ in seen.elements]


def test_captions_are_shown_and_read_aloud_as_they_were_written(tmp_path):
    file = tmp_path / "a.png"
    Image.new("RGB", (2, 2)).save(file)
    seen = Seen(html.figure(file, NAME, larger='a"b.svg'))
    assert [tag for tag, _ in seen.elements] == ["figure", "a", "img", "figcaption"]
    elements = dict(seen.elements)
    assert elements["img"]["alt"] == seen.texts["figcaption"] == NAME
    assert elements["img"]["src"].startswith("data:image/png;base64,")
    assert elements["a"]["href"] == 'a"b.svg'


def test_a_table_has_a_head_and_a_class_for_each_row():
    seen = Seen(html.table(["a", "b"], [["1", "2"], ["3", "4"]], ["good", "bad"]))
    assert [kind["class"] for tag, kind in seen.elements if tag == "tr" and kind] == ["good", "bad"]
    assert [tag for tag, _ in seen.elements].count("td") == 4
    assert [tag for tag, _ in seen.elements].count("th") == 2
    assert "thead" not in html.table([], [["1"]])


@pytest.mark.parametrize(
    ("value", "digits", "text"),
    [(-0.149633, 4, "−0.1496"), (-0.0, 4, "0"), (1e-7, 4, "1e−07"), (2 / 3, 2, "0.67")],
)
def test_numbers_are_rounded_with_proper_minus_signs(value, digits, text):
    assert html.number(value, digits) == text
