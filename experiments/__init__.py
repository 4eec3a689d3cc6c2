"""The experiments, one file for each: what to run, and how to draw it."""
