"""The Hub as a client sees it: repositories, revisions, downloads, and what its errors mean."""
