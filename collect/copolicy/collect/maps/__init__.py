"""Files of one's own maps, and sheets of any set."""
