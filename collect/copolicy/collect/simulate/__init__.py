"""Episodes of scripted pairs in simulated time."""
