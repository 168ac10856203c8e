"""The benchmark of control: how well, how strongly and how soon methods make a fluid follow sketches."""
