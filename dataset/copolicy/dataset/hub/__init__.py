"""Hugging Face Hub client: repositories, revisions, downloads, and one-line error messages."""
