"""`copolicy-collect play`: two players, one table, and every episode on the disk."""
