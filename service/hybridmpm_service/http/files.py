"""Files of the page: compressed once, and kept by browsers for as long as they are the present ones.

Each file has two addresses. The one below `/page-DIGEST/`, with the digest of all files, never changes its
content; the front page names its files so, and finds the modules of its start there as one file. The other
one, such as `/client.js`, is asked for anew each time.
"""

import asyncio
import functools
import gzip
import hashlib
import mimetypes
import re
from collections.abc import Mapping
from html import escape
from pathlib import Path
from typing import NamedTuple

from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import Response
from starlette.routing import BaseRoute, Match
from starlette.types import Receive, Scope, Send

from hybridmpm.errors import ConfigError
from hybridmpm.playing import MODULES, drawing_of_bodies, module
from hybridmpm_service.http.bundle import bundled
from hybridmpm_service.http.connection import SECURITY_HEADERS

PAGE = Path(__file__).parents[1] / "page"
"""Folder of the page's files."""
FRONT = "index.html"
_START = "main.js"
_BODIES = "modules/bodies.js"
"""Name of the module that draws rigid bodies, which the library has for pages that play."""
_FOREVER = "public, max-age=31536000, immutable"
_MOST_FRONTS = 16
"""Number of front pages that are kept: one for each address by which the service is reached."""
_LEAST_SAVED = 0.9
"""Size over that of the file below which a compressed one is sent."""
_TYPES = {".js": "text/javascript", ".ts": "text/plain", ".svg": "image/svg+xml", ".json": "application/json"}
_IN_FOLDER = re.compile(r"/page-([0-9a-f]{16})(?=/)")
_NAMED = re.compile(r'((?:href|src)=")([^":#{]+)"')


class File(NamedTuple):
    """A file as it is sent."""

    media_type: str
    tag: str
    plain: bytes
    packed: bytes | None
    """The same by gzip; None where that saves little."""

    def answer(self, request: Request, headers: Mapping[str, str]) -> Response:
        """Return the answer to a request, which is empty where the client has the file already."""
        packed = self.packed if _takes_gzip(request.headers.get("accept-encoding", "")) else None
        tag = f'"{self.tag}"' if packed is None else f'"{self.tag}-gzip"'
        headers = {"ETag": tag, **headers}
        if self.packed is not None:
            headers["Vary"] = "Accept-Encoding"
        known = request.headers.get("if-none-match", "").split(",")
        if tag in (one.strip().removeprefix("W/") for one in known):
            return Response(status_code=304, headers=headers)
        if packed is not None:
            headers["Content-Encoding"] = "gzip"
        return Response(self.plain if packed is None else packed, media_type=self.media_type, headers=headers)


def _file(name: str, content: bytes, packed: bytes | None = None) -> File:
    suffix = Path(name).suffix
    kind = _TYPES.get(suffix) or mimetypes.guess_type(name)[0] or "application/octet-stream"
    packed = packed or gzip.compress(content, 9, mtime=0)
    worth = len(packed) < _LEAST_SAVED * len(content)
    return File(kind, hashlib.sha256(content).hexdigest()[:32], content, packed if worth else None)


def _takes_gzip(accepted: str) -> bool:
    """Return whether a client takes gzip: it names it, and does not weigh it with zero."""
    for one in accepted.lower().split(","):
        name, _, weight = one.partition(";")
        if name.strip() in {"gzip", "x-gzip", "*"}:
            return re.fullmatch(r"\s*q\s*=\s*0(\.0*)?\s*", weight) is None
    return False


class Files:
    """The files of a folder and the compiled solvers, each read and compressed once, at its first use.

    Attributes
    ----------
    digest : str
        Start of the SHA-256 of all names and contents.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self.names = {one.relative_to(folder).as_posix() for one in folder.rglob("*") if one.is_file()}
        whole = hashlib.sha256()
        for name in sorted(self.names):
            whole.update(name.encode() + b"\0" + hashlib.sha256((folder / name).read_bytes()).digest())
        self.names.discard(FRONT)
        whole.update(drawing_of_bodies().encode())
        self.names.add(_BODIES)
        for name in MODULES:
            try:
                whole.update(hashlib.sha256(module(name)).digest())
            except ConfigError:
                continue
            self.names.add(f"modules/{name}.wasm")
        self.digest = whole.hexdigest()[:16]
        self._made: dict[tuple[str, bool], File] = {}
        self._fronts: dict[str, File] = {}

    def _make(self, name: str, *, bundled: bool) -> File:
        if name.endswith(".wasm"):
            packed = module(Path(name).stem)
            return _file(name, gzip.decompress(packed), packed)
        if bundled and name in self._modules:
            return _file(name, self._modules[name].encode())
        return _file(
            name, self._text(name).encode() if name == _BODIES else (self._folder / name).read_bytes()
        )

    @functools.cached_property
    def _modules(self) -> dict[str, str]:
        names = (name for name in self.names if name.endswith(".js"))
        return bundled({name: self._text(name) for name in names}, _START)

    def _text(self, name: str) -> str:
        """Return the text of a module."""
        return drawing_of_bodies() if name == _BODIES else (self._folder / name).read_text(encoding="utf-8")

    async def file(self, name: str, *, bundled: bool) -> File:
        """Return a file; it is read and compressed in a thread, where this is its first use.

        `bundled` says whether the modules of the start are one file.
        """
        key = (name, bundled)
        found = self._made.get(key)
        if found is None:
            found = self._made[key] = await asyncio.to_thread(self._make, name, bundled=bundled)
        return found

    @functools.cached_property
    def _front(self) -> str:
        """The front page, which names its files by the addresses that never change."""

        def named(place: re.Match[str]) -> str:
            folder = f"page-{self.digest}/" if place[2] in self.names else ""
            return f'{place[1]}{folder}{place[2]}"'

        return _NAMED.sub(named, (self._folder / FRONT).read_text(encoding="utf-8"))

    async def front(self, address: str, *, framed: bool = False) -> File:
        """Return the front page of a service at an address, with its cards or for frames of other pages.

        Previews of links need the whole address of their picture in it. Names that clients make up are not
        kept, nor compressed.
        """
        key = f"{framed} {address}"
        found = self._fronts.get(key)
        if found is not None:
            return found
        text = self._front.replace("{{address}}", escape(address))
        if framed:
            text = text.replace("<body ", '<body data-embed="true" ', 1)
        if len(self._fronts) >= _MOST_FRONTS:
            content = text.encode()
            return File("text/html", hashlib.sha256(content).hexdigest()[:32], content, None)
        made = self._fronts[key] = await asyncio.to_thread(_file, FRONT, text.encode())
        return made


@functools.cache
def page_files() -> Files:
    """Return the files of the page, which all applications of a process share."""
    return Files(PAGE)


class FilesRoute(BaseRoute):
    """Route of all files: of those that there are, so that other addresses are free for other routes."""

    path = "/main.js"
    methods = frozenset({"GET", "HEAD"})

    def __init__(self, files: Files) -> None:
        self._files = files

    def matches(self, scope: Scope) -> tuple[Match, Scope]:
        """Return whether the path is that of a file."""
        if scope["type"] != "http" or self._place(scope)[1] not in self._files.names:
            return Match.NONE, {}
        return Match.FULL if scope["method"] in self.methods else Match.PARTIAL, {}

    async def handle(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer with the file."""
        if scope["method"] not in self.methods:
            raise HTTPException(405, headers={"Allow": ", ".join(sorted(self.methods))})
        digest, name = self._place(scope)
        # A page of before an update finds the present files, as at the other addresses.
        headers = {"Cache-Control": _FOREVER} if digest == self._files.digest else {}
        answer = (await self._files.file(name, bundled=bool(digest))).answer(Request(scope), headers)
        await answer(scope, receive, send)

    @staticmethod
    def _place(scope: Scope) -> tuple[str, str]:
        """Return the digest in an address, which may be empty, and the name of its file."""
        path: str = scope["path"].removeprefix(scope.get("root_path", ""))
        folder = _IN_FOLDER.match(path)
        return ("", path[1:]) if folder is None else (folder[1], path[folder.end() + 1 :])


async def front(request: Request) -> Response:
    """Return the page."""
    return (await page_files().front(_address(request))).answer(request, {})


async def framed(request: Request) -> Response:
    """Return the page without its cards, for frames of this site and of the other front ends."""
    origins = [one for one in request.app.state.settings.cors_origins if one != "null"]
    ancestors = " ".join(("frame-ancestors 'self'", *origins))
    policy = SECURITY_HEADERS["Content-Security-Policy"].replace("frame-ancestors 'none'", ancestors)
    page = await page_files().front(_address(request), framed=True)
    return page.answer(request, {"Content-Security-Policy": policy})


def _address(request: Request) -> str:
    return str(request.base_url).rstrip("/")
