"""Files of the original program, in its three formats."""
