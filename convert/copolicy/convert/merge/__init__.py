"""Several data sets of this project, of several labs perhaps, as one."""
