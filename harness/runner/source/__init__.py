"""Which source files a measurement depends on, and one hash of their code."""
