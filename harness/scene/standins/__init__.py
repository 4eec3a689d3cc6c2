"""Stand-ins: procedural geometry that replaces the scenes of the paper, which cannot be distributed."""
