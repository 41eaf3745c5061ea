"""Lists, identifies, reads and locks files and folders, and writes them atomically."""
