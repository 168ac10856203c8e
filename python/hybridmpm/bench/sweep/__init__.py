"""The sweep over networks: latencies of all points, trainings of the points that may pay, and a chart."""
