"""Edits data sets: select, split without leakage, withdraw a consent, amend and restore columns."""
