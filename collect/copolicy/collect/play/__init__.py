"""`copolicy-collect play`: two players act together, and every episode is recorded."""
