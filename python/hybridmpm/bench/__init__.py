"""Measurements that anyone can repeat: each command of `hybridmpm bench` makes the rows of one result.

Rooms import each other in one order: `report` and `peers`; `accuracy`; then `speed`, `hybrid`, `sweep`,
`stability` and `service`, which know nothing of each other. `staleness` reads the code of all as text and
imports none.
"""
