"""`Tracks`: states of a simulator in one array each, although particles may come and go."""

import numpy as np
import numpy.typing as npt

from hybridmpm.simulator import Simulator


class Tracks:
    """Arrays (rows, N, D) with a column for each particle that was in the scene at one of the rows.

    Where a particle was not in the scene, its entries are NaN.

    Parameters
    ----------
    solver : Simulator
        Simulator whose states are taken.
    rows : int
        Number of states to take.
    names : str
        Names of properties of the simulator that have the shape (N, D).
    """

    def __init__(self, solver: Simulator, rows: int, *names: str) -> None:
        self._solver = solver
        # Rows are filled when they are taken: to fill a large table takes long, and Ctrl-C would wait for it.
        self._tables = {name: self._room(rows, solver.particle_count) for name in names}
        self.ids = np.empty(0, dtype=np.uint64)
        """Ids (N,) of the columns' particles, ascending."""
        self.types = np.empty(0, dtype=np.uint8)
        """DeepMind's particle types (N,) of the columns."""
        self.mass = np.empty(0, dtype=np.float32)
        """Masses (N,) of the columns' particles [kg]."""

    def __getitem__(self, name: str) -> npt.NDArray[np.float32]:
        """Return the array (rows, N, D) of a property; rows that were not taken have no meaning."""
        return self._tables[name][:, : len(self.ids)]

    def take(self, row: int) -> None:
        """Write the present state into a row; rows must be taken in the order of time."""
        ids = self._solver.ids
        fresh = ids > self.ids[-1] if len(self.ids) else np.ones(len(ids), dtype=bool)
        self.ids = np.append(self.ids, ids[fresh])
        self.types = np.append(self.types, self._solver.materials[fresh])
        self.mass = np.append(self.mass, self._solver.mass[fresh])
        columns = np.searchsorted(self.ids, ids)
        for name in self._tables:
            self._grow(name)
            self._tables[name][row] = np.nan
            self._tables[name][row, columns] = getattr(self._solver, name)

    def lengthen(self, rows: int) -> None:
        """Make room for more rows."""
        for name, table in self._tables.items():
            self._tables[name] = np.concatenate([table, self._room(rows, table.shape[1])])

    def _grow(self, name: str) -> None:
        table = self._tables[name]
        rows, room, _ = table.shape
        if room < len(self.ids):
            more = self._room(rows, max(len(self.ids), room + room // 2) - room)
            more[:] = np.nan
            self._tables[name] = np.concatenate([table, more], axis=1)

    def _room(self, rows: int, columns: int) -> npt.NDArray[np.float32]:
        return np.empty((rows, columns, self._solver.dim), dtype=np.float32)
