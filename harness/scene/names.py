"""The catalogue's scenes by name, and what is to be said of the paper's ones and of their stand-ins. Apart from the
catalogue, so that it can be read without the file readers.
"""

import importlib
from dataclasses import dataclass

from .scene import Camera, Light, Scene, Vector


@dataclass(frozen=True)
class Paper:
    """A scene of the paper, for which there is a stand-in (:mod:`.scene.standins`).

    triangles  of the stand-in; an original has its own number
    of         what the stand-in stands in for
    camera, light, closed, notes  of the stand-in's :class:`.scene.scene.Scene`
    moves      whether it has more than one frame
    """

    title: str
    triangles: int
    of: str
    notes: str
    camera: Camera
    light: Vector
    closed: bool = False
    moves: bool = False


PAPER = {  # in the order of its Table 1
    "fairy": Paper(
        "Fairy Forest", 174_114, "Utah Fairy Forest",
        "a very large ground, a few dense figures, thousands of leaves and blades; the motion is periodic",
        Camera((0.75, 1.55, 3.7), (0.0, 1.02, 0.0), fov=42.0), (3.2, 6.5, 4.2), moves=True,
    ),
    "sibenik": Paper(  # up the nave from the west door; the light hangs in the nave, before the crossing
        "Sibenik", 82_298, "Sibenik Cathedral by Marko Dabrovic",
        "interior with very large, long thin and finely tessellated triangles side by side",
        Camera((-18.2, 5.0, -1.7), (6.0, 6.6, 0.5), fov=66.0), (-0.87, 9.05, 1.17),
    ),
    "bunny_dragon": Paper(
        "Bunny/Dragon", 253_092, "UNC Bunny/Dragon animation (exploding dragon)",
        "two dense bodies; after the impact every patch of them flies on its own",
        Camera((-2.5, 1.35, 2.9), (-0.74, 0.56, 0.0), fov=44.0), (-1.6, 4.2, 3.4), moves=True,
    ),
    "conference": Paper(  # from a corner over the table; the light is inside, just below the ceiling
        "Conference", 285_036, "Conference Room by Anat Grynberg and Greg Ward",
        "closed room, light inside; furniture of all sizes and many large triangles",
        Camera((-5.55, 2.15, 3.2), (0.6, 0.62, -0.45), fov=58.0), (0.7, 2.8, 0.5),
    ),
    "cloth": Paper(
        "Cloth", 92_210, "UNC Cloth/Ball animation",
        "simulated: XPBD sheet of 72 x 72 vertices with self-contact, refined to 214 x 214",
        Camera((0.5, 1.85, 1.95), (0.0, 0.3, 0.08), fov=42.0), (1.6, 3.4, 1.4), moves=True,
    ),
    "buddha": Paper(  # the statue fills most of the image; the light is in front of it and above
        "Buddha", 1_087_068, "Happy Buddha of the Stanford 3D Scanning Repository",
        "one closed surface from signed distances, 1.09M triangles of nearly one size",
        Camera((0.75, 1.35, 4.6), (0.0, 0.96, 0.0), fov=26.5), (-2.2, 4.2, 4.0), closed=True,
    ),
}  # fmt: skip

NAMES = tuple(PAPER)

BUNNY = "bunny"  # the small real scene that needs no download: it ships inside the warp-lang package

TITLES = {name: one.title for name, one in PAPER.items()} | {BUNNY: "Bunny"}
TRIANGLES = {name: one.triangles for name, one in PAPER.items()} | {BUNNY: 12_200}
ANIMATED = tuple(name for name, one in PAPER.items() if one.moves)


def scene_names() -> list[str]:
    """Every name of the catalogue, the paper's scenes first."""
    return [*NAMES, BUNNY]


def stand_in(name: str) -> Scene:
    """The stand-in for a scene of the paper; its module makes the geometry, when that is asked for."""
    one = PAPER[name]
    return Scene(
        name, f"{one.title} (stand-in)",
        lambda: importlib.import_module(f".standins.{name}", __package__).geometry(), one.camera, (Light(one.light),),
        stand_in=f"procedural stand-in for the {one.of}", closed=one.closed, notes=one.notes,
    )  # fmt: skip
