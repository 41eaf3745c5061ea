"""Map files of a lab, and sheets that show a set of maps."""
