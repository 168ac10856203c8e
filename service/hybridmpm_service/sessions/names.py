"""Names of sessions and jobs: random, and on one node of several they begin with its name."""

import re
import uuid

from hybridmpm_service.errors import OtherNodeError

PATTERN = re.compile(r"[0-9a-f]{32}")


def new(start: str) -> str:
    """Return a new name with a start."""
    return start + uuid.uuid4().hex[len(start) :]


def check_node(name: str, node: str) -> None:
    """Raise `OtherNodeError` if a name is of another node than this one; a node without name owns all."""
    if node and PATTERN.fullmatch(name) and not name.startswith(node):
        raise OtherNodeError(
            f"{name!r} is of node {name[:2]}, and this is node {node}: ask that node, or the proxy of both"
        )
