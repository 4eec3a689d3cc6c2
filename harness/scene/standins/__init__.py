"""Stand-ins: geometry made by a program in place of the scenes of the paper."""
