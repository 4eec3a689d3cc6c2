"""The names of the catalogue's scenes, in a module apart from the catalogue, so that names can be read without the file
readers."""

NAMES = ("fairy", "sibenik", "bunny_dragon", "conference", "cloth", "buddha")
"""The paper's scenes, in the order of its Table 1. Each has a stand-in of that name (:mod:`.scene.standins`)."""

BUNNY = "bunny"
"""The small real scene that needs no download: it ships inside the warp-lang package."""

TRIANGLES = {
    "fairy": 174_114, "sibenik": 82_298, "bunny_dragon": 253_092, "conference": 285_036, "cloth": 92_210,
    "buddha": 1_087_068, BUNNY: 12_200,
}  # fmt: skip
"""Numbers of triangles of the stand-ins and of the bunny; an original has its own number."""

ANIMATED = ("fairy", "bunny_dragon", "cloth")
"""The scenes that have more than one frame."""


def scene_names() -> list[str]:
    """Every name of the catalogue, the paper's scenes first."""
    return [*NAMES, BUNNY]
