"""Taking out and mending: a selection, parts without leakage, withdrawn consents, amended and restored columns."""
