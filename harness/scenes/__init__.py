"""The catalogue: procedural stand-ins for the scenes of the paper, and files."""
