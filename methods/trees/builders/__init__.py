"""Building a tree each frame: keys, sort, LBVH or H-PLOC; or refitting one that was made on the host."""
