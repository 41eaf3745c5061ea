"""Files and folders: which there are, what they are, and writing them whole or not at all."""
