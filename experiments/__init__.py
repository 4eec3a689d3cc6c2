"""One file per item of the paper or of our own: what to run, and how to draw it."""
