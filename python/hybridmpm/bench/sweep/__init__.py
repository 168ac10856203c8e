"""The sweep over networks: latencies of all points, trainings of those that may pay, charts."""
