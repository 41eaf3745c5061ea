"""Repository names, licences, versions and the minimal card of a data set on the Hub."""
