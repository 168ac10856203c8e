"""Commands that chart speed against accuracy, and hold plans against the chart."""
