"""Numbers of the particle types, which mean different things to different projects.

Within the library the numbers are DeepMind's (Sanchez-Gonzalez et al. 2020): 0 rigid, 3 kinematic, 5 water,
6 sand, 7 goop; 8, a viscous liquid, is ours. LagrangeBench (`NodeType` in its utils.py) has 0 fluid, 1 wall,
2 moving wall, 3 rigid. So a ramp, which is 3 to DeepMind, would fall like a rigid body if LagrangeBench read
it without translation.
"""

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt

from hybridmpm.errors import DataError
from hybridmpm.scene.materials import Elastic, Liquid, Sand, Water

RIGID, KINEMATIC = 0, 3
WATER, SAND, GOOP, LIQUID = (one.type_id for one in (Water(), Sand(), Elastic(), Liquid()))
NAMES: Mapping[int, str] = {
    RIGID: "rigid",
    KINEMATIC: "kinematic",
    WATER: "water",
    SAND: "sand",
    GOOP: "goop",
    LIQUID: "liquid",
}

UNCHANGED: Mapping[int, int] = {number: number for number in NAMES}
TO_LAGRANGEBENCH: Mapping[int, int] = {
    RIGID: 3,
    KINEMATIC: 1,
    WATER: 0,
    SAND: SAND,
    GOOP: GOOP,
    LIQUID: LIQUID,
}
FROM_LAGRANGEBENCH: Mapping[int, int] = {
    0: WATER,
    1: KINEMATIC,
    2: KINEMATIC,
    3: RIGID,
    SAND: SAND,
    GOOP: GOOP,
    LIQUID: LIQUID,
}


def translated(
    types: npt.NDArray[np.integer], table: Mapping[int, int], *, where: str
) -> npt.NDArray[np.int64]:
    """Replace each type by its entry in `table`; the result has the shape of `types`.

    Raises
    ------
    DataError
        A type is not in the table. The message begins with `where` and lists the types that are.
    """
    present, inverse = np.unique(types, return_inverse=True)
    unknown = [int(number) for number in present if int(number) not in table]
    if unknown:
        allowed = ", ".join(str(number) for number in sorted(table))
        raise DataError(f"{where} holds particle type {unknown[0]}; this format has {allowed}")
    renamed = np.array([table[int(number)] for number in present], dtype=np.int64)
    return np.asarray(renamed[inverse].reshape(types.shape))
