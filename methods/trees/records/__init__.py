"""Records of triangles, made once a frame, with which a test of a ray takes few instructions."""
