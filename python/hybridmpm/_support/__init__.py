"""Helpers of all rooms: argument checks, safe files, packed snapshots, facts about the machine."""
