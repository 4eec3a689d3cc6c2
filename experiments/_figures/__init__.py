"""Tables and drawings of single experiments."""
