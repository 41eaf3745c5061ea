"""One MCAP file an episode: its topics and records, and how they are read."""
