"""The paper's co-planning study."""
