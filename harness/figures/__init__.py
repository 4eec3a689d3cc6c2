"""Tables and drawings: pure functions of the records."""
