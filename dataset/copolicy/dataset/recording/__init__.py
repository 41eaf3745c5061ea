"""Recordings: one MCAP file per episode, with its topics, metadata records and reader."""
