"""Reading LeRobot v3 data set folders. This file imports nothing, so that a command line without one stays quick."""
