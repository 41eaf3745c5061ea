"""Statistics of designs in which every unit of analysis (a person, a map) has a value in every condition."""
