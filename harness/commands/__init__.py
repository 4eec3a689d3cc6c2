"""The commands a person types, one group a file; the command line registers them."""
