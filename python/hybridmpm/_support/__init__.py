"""Checks of arguments, files, charts and facts about the machine: what every room may use."""
