"""A light's grid on a cube around it, over whose cells triangles are streamed."""
