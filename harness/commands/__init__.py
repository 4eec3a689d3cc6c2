"""The commands of the command line, one group per file; the command line registers them."""
