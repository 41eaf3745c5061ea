"""Episodes of a consent id deleted from recordings, data sets and the records of releases."""
