"""Markdown as HTML that contains nothing but text, its structure and links."""

from collections.abc import Iterator

from markdown_it import MarkdownIt
from markdown_it.token import Token

_DEEPEST = 6
"""Level of the smallest heading of HTML."""


def html_of(markdown: str) -> str:
    """Return CommonMark as HTML: headings, paragraphs, lists, quotations, emphasis, code and links.

    HTML within the text is shown as it is written, addresses that run code are no links, and pictures become
    links, so that a page loads nothing. Headings are a level below the page's own.
    """
    reader = MarkdownIt("commonmark", {"html": False}).disable("image")
    tokens = reader.parse(markdown)
    for token in _headings(tokens):
        token.tag = f"h{min(int(token.tag[1:]) + 1, _DEEPEST)}"
    rendered: str = reader.renderer.render(tokens, reader.options, {})
    return rendered


def _headings(tokens: list[Token]) -> Iterator[Token]:
    return (token for token in tokens if token.type in ("heading_open", "heading_close"))
