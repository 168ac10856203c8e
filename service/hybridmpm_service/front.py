"""The page: a file with the address of the server filled in."""

import functools
import hashlib
from html import escape
from pathlib import Path

from starlette.requests import Request
from starlette.responses import HTMLResponse, Response

PAGE = Path(__file__).parent / "page"
"""Folder of the page's files."""


def front(request: Request) -> Response:
    """Return the page; previews of links need the whole address of the picture in it."""
    text = _index().replace("{{address}}", escape(str(request.base_url).rstrip("/")))
    tag = f'"{hashlib.sha256(text.encode()).hexdigest()[:32]}"'
    if request.headers.get("if-none-match") == tag:
        return Response(status_code=304, headers={"ETag": tag})
    return HTMLResponse(text, headers={"ETag": tag})


@functools.cache
def _index() -> str:
    return (PAGE / "index.html").read_text(encoding="utf-8")
