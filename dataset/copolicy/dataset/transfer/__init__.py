"""A released data set on its way to the Hub and back, whole."""
