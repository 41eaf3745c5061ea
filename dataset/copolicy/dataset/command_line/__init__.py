"""What every command has in common: parsers, output, exit status, flags that are numbers."""
