"""Helpers of all rooms: argument checks, safe files, packed snapshots, charts, facts about the machine."""
