"""Snapshots of networks and hybrids are trees of plain data, arrays and bytes."""

from typing import Any

import numpy as np
import pytest

from hybridmpm import SnapshotError
from hybridmpm._support.packing import from_bytes, to_bytes

MAGIC = b"HMPMTEST"


def test_a_tree_comes_back() -> None:
    tree: dict[str, Any] = {
        "numbers": [1, 2.5, float("inf"), None, True, "text"],
        "array": np.arange(6, dtype=np.float32).reshape(2, 3),
        "nested": {"bytes": b"\x00\xff", "list": [{"array": np.empty((0, 2))}, []]},
        "numpy": np.float32(0.5),
    }
    data = to_bytes(MAGIC, 3, tree)
    assert to_bytes(MAGIC, 3, tree) == data
    again = from_bytes(MAGIC, 3, data)
    assert again["numbers"] == tree["numbers"]
    assert again["array"].dtype == np.float32
    np.testing.assert_array_equal(again["array"], tree["array"])
    assert again["nested"]["bytes"] == b"\x00\xff"
    assert again["nested"]["list"][0]["array"].shape == (0, 2)
    assert again["nested"]["list"][1] == []
    assert again["numpy"] == 0.5


def test_what_is_no_snapshot_is_refused() -> None:
    data = to_bytes(MAGIC, 3, {"a": 1})
    with pytest.raises(SnapshotError, match="no snapshot of this kind"):
        from_bytes(b"HMPMELSE", 3, data)
    with pytest.raises(SnapshotError, match="checksum does not match"):
        from_bytes(MAGIC, 3, data[:-1])
    with pytest.raises(SnapshotError, match="has version 3, but this hybridmpm reads version 4"):
        from_bytes(MAGIC, 4, data)
    with pytest.raises(SnapshotError, match="but not object"):
        to_bytes(MAGIC, 3, {"a": object()})
