"""`bench downsampling`: the ladders of MPM with fewer particles, by error, transport and time."""

from hybridmpm.bench.downsampling.chart import chart
from hybridmpm.bench.downsampling.ladders import DownsamplingSettings, measure

__all__ = ["DownsamplingSettings", "chart", "measure"]
