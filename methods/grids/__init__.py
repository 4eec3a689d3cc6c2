"""Grids over all triangles, rebuilt every frame by sorting (triangle, cell) pairs: the library of the methods that walk
through cells.

    grid      where a grid lies, and how much its cells must overlap
    binning   which cells a triangle is listed in
    pairs     the kernels that bin into any grid; the pairs, sorted by cell
    build     one grid over all triangles, its parameters and the passes that build it
    walk      a ray from cell to cell
    cells     the kernels that trace rays through one grid
"""
