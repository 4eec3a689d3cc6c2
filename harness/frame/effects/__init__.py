"""What the effects of a scene add to every method's frame: receivers, mirrored rays, colour; and kernels without the code
of effects that a scene has not.
"""
