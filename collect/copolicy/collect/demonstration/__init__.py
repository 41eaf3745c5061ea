"""A policy at work: episodes with a simulated partner, as a film that says so."""
