"""Merges several data sets of this project, for example of several labs, to one."""
