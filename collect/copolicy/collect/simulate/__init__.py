"""Episodes of scripted pairs, as fast as the machine goes."""
