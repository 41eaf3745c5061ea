"""Rules that a data set should keep before anybody uses it: one family a module, every limit in `limits`.

`checking.check_dataset` runs them all; this file imports nothing, so that a command line without a check stays quick.
"""
