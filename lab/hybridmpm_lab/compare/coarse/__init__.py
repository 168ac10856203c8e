"""`bench downsampling`: the ladders of MPM with fewer particles, by error, transport and time."""

from hybridmpm_lab.compare.coarse.chart import chart
from hybridmpm_lab.compare.coarse.ladders import DownsamplingSettings, measure

__all__ = ["DownsamplingSettings", "chart", "measure"]
