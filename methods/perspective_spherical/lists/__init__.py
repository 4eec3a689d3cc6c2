"""Lists of triangles and rays for tiles: binning, chunks, and items of work."""
