"""Recordings: the states of a simulation at some of its frames, even if particles come and go."""

from hybridmpm.recording.recording import Recording, checked_recording, record
from hybridmpm.recording.tracks import Tracks

__all__ = ["Recording", "Tracks", "checked_recording", "record"]
