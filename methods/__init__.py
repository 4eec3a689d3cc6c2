"""One folder a method, beside the libraries that they share. A method never times, scores or reads the exact reference."""

LOOKS = {
    "ray_grids": ("#0072B2", "o"),
    "hybrid": ("#56B4E9", "^"),
    "bvh2": ("#009E73", "s"),
    "visibility_buffer": ("#E69F00", "D"),
    "warp_bvh": ("#D55E00", "v"),
    "perspective_spherical": ("#8C564B", "P"),
    "embree": ("#882255", "X"),
    "uniform_grid": ("#CC79A7", "*"),
    "two_level_grid": ("#332288", "<"),
    "coherent_grid": ("#44AA99", ">"),
    "kdtree": ("#999933", "p"),
    "shadow_map": ("#DDCC77", "h"),
    "accuracy_ladder": ("#661100", "d"),
    "driver": ("#117733", "H"),
    "two_level_bvh": ("#AA4499", "d"),
}
"""The colour and the marker of each method in every drawing. The first eight are distinct with every common colour vision
(Okabe and Ito's colours, a wine red, a brown); a method that is not listed gets one from its name.
"""

KINDS = {
    **dict.fromkeys(("ray_grids", "hybrid"), "grids of rays"),
    **dict.fromkeys(("bvh2", "warp_bvh", "embree", "kdtree", "accuracy_ladder", "driver", "two_level_bvh"), "trees"),
    **dict.fromkeys(("visibility_buffer", "shadow_map"), "rasterised buffers"),
    "perspective_spherical": "the paper's grids",
    **dict.fromkeys(("uniform_grid", "two_level_grid", "coherent_grid"), "grids of triangles"),
}
"""The kind of structure of each method, for tables that show the best of each kind; others are a kind of their own."""

FORMER_LABELS = {
    **dict.fromkeys([f"perspective + spherical{end}" for end in ("", ", tuned", ", best")], "the paper's grids"),
    **dict.fromkeys(("bvh2", "BVH2 (rebuilt in the graph)"), "BVH2 rebuilt"),
    "bvh2, float32": "BVH2 rebuilt, float32",
    **dict.fromkeys(("Warp mesh", "BVH (Warp)"), "mesh rebuilt"),
    "Warp mesh, plain origins": "mesh rebuilt, plain",
    **dict.fromkeys(("Warp BVH, exact", "BVH rebuilt in place, exact"), "LBVH rebuilt in a graph"),
    "Ray grids (streamed)": "ray grids",
    "Uniform grid": "uniform grid",
}
"""What records call a method with its settings that has one name in all tables now."""
