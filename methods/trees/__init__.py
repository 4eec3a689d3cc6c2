"""A tree of triangles: how it is built, records of triangles for its rays, and how rays are traced through it."""
