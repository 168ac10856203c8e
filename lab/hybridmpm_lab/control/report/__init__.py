"""What is told of the runs: means beside aims, a chart, and contact sheets."""
