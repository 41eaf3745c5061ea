"""Many action chunks from one state."""
