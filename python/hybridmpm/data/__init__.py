"""Data sets of trajectories: made from scenarios, described, drawn, and converted between formats.

`plan` and `generate` make the trajectories of a `Recipe`. `FORMATS[name].read(folder, split, None)` yields
the trajectories of a data set, also of another project's, as `Trajectory`. docs/guide/datasets.md describes
the files. HDF5 needs h5py: `pip install 'hybridmpm[data]'`.
"""

from hybridmpm.data.control import Control
from hybridmpm.data.convert import Converted, convert
from hybridmpm.data.formats import FORMATS, Format, detect
from hybridmpm.data.generation.executors import Outcome, RayTasks, Threads, produce
from hybridmpm.data.generation.generate import Plan, Report, generate, plan
from hybridmpm.data.generation.simulate import simulate
from hybridmpm.data.hdf5 import h5py
from hybridmpm.data.recipe import Recipe
from hybridmpm.data.splits import Seeds
from hybridmpm.data.statistics import Statistics, statistics
from hybridmpm.data.template import SceneTemplate
from hybridmpm.data.trajectory import Trajectory

__all__ = [
    "FORMATS",
    "Control",
    "Converted",
    "Format",
    "Outcome",
    "Plan",
    "RayTasks",
    "Recipe",
    "Report",
    "SceneTemplate",
    "Seeds",
    "Statistics",
    "Threads",
    "Trajectory",
    "convert",
    "detect",
    "generate",
    "h5py",
    "plan",
    "produce",
    "simulate",
    "statistics",
]
