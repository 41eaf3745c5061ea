"""Records episodes as MCAP files, and recovers incomplete recordings."""
