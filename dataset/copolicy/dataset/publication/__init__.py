"""Names, licences and the smallest card of a data set that goes to the Hub."""
