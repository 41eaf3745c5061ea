"""A part of a data set as a data set of its own: what is read, what is written, and how it takes its place."""
