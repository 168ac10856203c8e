"""What is done to the methods of the stability map, kind by kind."""
