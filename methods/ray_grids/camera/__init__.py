"""The camera's grid, a pixel a cell, over which triangles are streamed."""
