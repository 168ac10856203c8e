"""Writes tfrecords as DeepMind's are, by Google's own protobuf library: independent of our reader."""

import json
import struct
from pathlib import Path
from typing import Any

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

from hybridmpm import data
from hybridmpm.data.formats.tfrecord import crc32c, masked


def _message_classes() -> dict[str, Any]:
    """Build the messages of tensorflow/core/example/{feature,example}.proto."""
    file = descriptor_pb2.FileDescriptorProto(name="example.proto", package="t", syntax="proto3")
    one, many = 1, 3
    integer, text, binary, message = 3, 9, 12, 11

    def add(name: str, *fields: tuple[str, int, int, int, str], mapped: str = "") -> None:
        made = file.message_type.add(name=name)
        for field, number, label, kind, type_name in fields:
            made.field.add(name=field, number=number, label=label, type=kind, type_name=type_name or None)
        if mapped:
            entry = made.nested_type.add(name="Entry")
            entry.options.map_entry = True
            entry.field.add(name="key", number=1, label=one, type=text)
            entry.field.add(name="value", number=2, label=one, type=message, type_name=mapped)

    add("BytesList", ("value", 1, many, binary, ""))
    add("Int64List", ("value", 1, many, integer, ""))
    add(
        "Feature",
        ("bytes_list", 1, one, message, ".t.BytesList"),
        ("int64_list", 3, one, message, ".t.Int64List"),
    )
    add("Features", ("feature", 1, many, message, ".t.Features.Entry"), mapped=".t.Feature")
    add("FeatureList", ("feature", 1, many, message, ".t.Feature"))
    add("FeatureLists", ("feature_list", 1, many, message, ".t.FeatureLists.Entry"), mapped=".t.FeatureList")
    add(
        "SequenceExample",
        ("context", 1, one, message, ".t.Features"),
        ("feature_lists", 2, one, message, ".t.FeatureLists"),
    )
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return {
        name: message_factory.GetMessageClass(pool.FindMessageTypeByName(f"t.{name}"))
        for name in ("SequenceExample", "Feature")
    }


def example(trajectory: data.Trajectory, key: int = 0, frames: Any = None) -> bytes:
    """Encode a trajectory as DeepMind does, or its types with other frames."""
    made = _message_classes()["SequenceExample"]()
    made.context.feature["key"].int64_list.value.append(key)
    made.context.feature["particle_type"].bytes_list.value.append(trajectory.types.tobytes())
    positions = made.feature_lists.feature_list["position"]
    for frame in trajectory.positions if frames is None else frames:
        positions.feature.add().bytes_list.value.append(frame.tobytes())
    return bytes(made.SerializeToString())


def record(content: bytes) -> bytes:
    """Frame a record, with both checksums."""
    length = struct.pack("<Q", len(content))
    return b"".join(
        [
            length,
            struct.pack("<I", masked(crc32c(length))),
            content,
            struct.pack("<I", masked(crc32c(content))),
        ]
    )


def write(folder: Path, split: str, trajectories: list[data.Trajectory], about: dict[str, Any]) -> None:
    """Write a split and metadata.json."""
    folder.mkdir(exist_ok=True)
    (folder / "metadata.json").write_text(json.dumps(about))
    records = [record(example(one, number)) for number, one in enumerate(trajectories)]
    (folder / f"{split}.tfrecord").write_bytes(b"".join(records))


def plain(about: dict[str, Any]) -> dict[str, Any]:
    """Keep what DeepMind's metadata hold."""
    keys = ("bounds", "sequence_length", "default_connectivity_radius", "dim", "dt")
    statistics = ("vel_mean", "vel_std", "acc_mean", "acc_std")
    return {key: about[key] for key in keys + statistics}


def particles(count: int = 5, frames: int = 4) -> data.Trajectory:
    """Return some positions, the last particle kinematic."""
    positions = np.random.default_rng(count).uniform(0.2, 0.8, (frames, count, 2)).astype(np.float32)
    return data.Trajectory(positions=positions, types=np.array([6] * (count - 1) + [3]))
