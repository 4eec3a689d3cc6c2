"""Rays in cells, and triangles streamed over them: the library of the methods that look from one point.

The rays that share an origin lie in the cells of a grid made for them, and every triangle tests the rays in the cells
that it covers. There are no lists of triangles, and nothing is sorted by triangles. In the camera's grid a cell is a
pixel. In a light's grid the cells lie on a cube around the light and hold the hit points, which are counted and
scattered each frame. Related work: the irregular z-buffer (Johnson 2005; Aila & Laine 2004; Wyman 2015).

The rooms, each of which imports only those before it:

    eight       what a CPU does with eight triangles, pixels or rays at once
    camera      the pixels of the image: planes, the stream, queued rows, what is left, the answers
    cube        the cube around a light: where it is aimed, its faces and cells, what a triangle covers of them
    rays        the rays of a light: their hit points, what they cover, receivers, and how they are sorted into cells
    occlusion   triangles against the rays of a light: planes, the stream, queued rows, undecided pairs
"""
