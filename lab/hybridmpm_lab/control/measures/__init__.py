"""What is measured of a fluid that has followed a sketch."""
