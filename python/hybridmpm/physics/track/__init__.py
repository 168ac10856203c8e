"""Particles that a network moves: its history, and the frames within its steps."""

from hybridmpm.physics.track.path import StepPath
from hybridmpm.physics.track.track import Track, warmup_frames

__all__ = ["StepPath", "Track", "warmup_frames"]
