"""What all policies of this plugin share: settings, checks of the data, inputs and their scaling."""
