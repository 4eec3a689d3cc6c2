"""Triangles against the rays of a light: planes, the stream, queued rows, undecided pairs."""
