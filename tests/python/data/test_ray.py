"""The executor ray on a real cluster of two nodes, each a process of its own on this machine."""

import subprocess
import sys
from pathlib import Path

import pytest
import yaml

from hybridmpm.data import metadata

from .conftest import DROPS, trajectories

pytestmark = pytest.mark.needs("ray", "ray")

CLUSTER = """
import sys
from ray.cluster_utils import Cluster

node = {"num_cpus": 1, "include_dashboard": False}
cluster = Cluster(initialize_head=True, head_node_args=node)
cluster.add_node(num_cpus=1)
cluster.wait_for_nodes()
print(cluster.address, flush=True)
sys.stdin.read()
cluster.shutdown()
"""


def generate(folder: Path, *more: str, count: int = 4) -> subprocess.CompletedProcess[str]:
    scene = folder.parent / "drops.yaml"
    scene.write_text(yaml.safe_dump(DROPS, sort_keys=False))
    words = ["dataset", "generate", "--scene", str(scene), "--out", str(folder), "--frames", "8"]
    command = [sys.executable, "-m", "hybridmpm", *words, "--trajectories", str(count), *more]
    return subprocess.run(command, capture_output=True, text=True, check=False)


@pytest.mark.long
def test_a_cluster_makes_the_same_data(tmp_path: Path) -> None:
    cluster = subprocess.Popen(
        [sys.executable, "-c", CLUSTER],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    )
    assert cluster.stdin is not None
    try:
        address = cluster.stdout.readline().strip()
        assert address
        # Resumed on threads, then extended on the cluster again: all executors work on the same data set.
        generate(tmp_path / "ray", count=1)
        result = generate(tmp_path / "ray", "--executor", "ray", "--ray-address", address)
        assert result.returncode == 0, result.stderr
        assert result.stdout.endswith("6 trajectories, 3 of them new\n")
    finally:
        cluster.stdin.close()
        cluster.stdout.close()
        cluster.wait()
    assert generate(tmp_path / "threads", "--threads", "2").returncode == 0
    assert metadata.read(tmp_path / "ray") == metadata.read(tmp_path / "threads")
    for split in ("train", "valid", "test"):
        pairs = zip(
            trajectories(tmp_path / "ray", split), trajectories(tmp_path / "threads", split), strict=True
        )
        assert all(one.digest == other.digest for one, other in pairs)


def test_a_cluster_that_does_not_answer(tmp_path: Path) -> None:
    result = generate(tmp_path / "ray", "--executor", "ray", "--ray-address", "127.0.0.1:1")
    assert result.returncode == 2, result.stderr
    assert "Error: no Ray cluster answers at '127.0.0.1:1': start one with" in result.stderr
    assert "Traceback" not in result.stderr
