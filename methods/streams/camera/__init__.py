"""The camera's grid, one pixel per cell, over which triangles are streamed."""
