"""Reads glTF 2.0 files, ``.glb`` and ``.gltf``."""

import dataclasses
from pathlib import Path

from ..checks import ALL, Loaded, Wanted, checked, guarded, some
from .accessors import Accessors
from .animation import Animation, first_animation
from .container import File, MissingError
from .entries import counted, refuse_required
from .frames import MOST_FRAMES, MOST_POSITIONS, Frames
from .model import Model
from .nodes import Tree
from .viewpoints import cameras, lights, moving


def read_gltf(path: Path, wanted: Wanted = ALL) -> Loaded:
    """All triangles of the default scene, and the wanted frames of its first animation. In glTF, y is up. Positions are
    float32 if all stand as the file stores them, else float64. Raises :class:`UserError` for extensions that may change
    what is drawn and cannot be read, for counts that exceed the file, and for files outside its folder."""
    with guarded(path, "glTF"):
        file = File(path)
        accessors = Accessors(file)
        refuse_required(file.head)
        tree = Tree(file)
        model = Model(accessors, tree, wanted.allow_missing)
        notes = list(model.notes)
        try:
            animation = first_animation(accessors, tree, model.blocks, wanted.rate)
        except MissingError:
            if not wanted.allow_missing:
                raise
            animation = None
            notes.append("animation left out, whose data are in a missing file")
        chosen = wanted.chosen(path, animation.count if animation else 1)
        if len(chosen) > MOST_FRAMES or len(chosen) * model.vertex_count > MOST_POSITIONS:
            problem = f"has {len(chosen)} frames of {model.vertex_count} vertices, more than memory may hold"
            raise file.error(problem, "choose some of them: --frames A:B:STEP")
        times = [animation.time(k) if animation else 0.0 for k in chosen]
        frames = Frames(model, tree, animation, times[0])
        mesh = checked(path, frames.points, model.faces(), (0.0, 1.0, 0.0))
        bodies = frames.bodies() if len(times) > 1 else None
        return dataclasses.replace(
            mesh,
            frames=(*mesh.frames, *(frames.at(time) for time in times[1:])),
            rate=animation.rate / chosen.step if animation and len(times) > 1 else None,
            bodies=None if bodies is None else bodies[mesh.faces[:, 0]],
            files=tuple(file.files),
            notes=(*notes, *_notes(file, model, animation, len(times)), *moving(file, tree)),
            cameras=cameras(file, tree, frames.first),
            lights=lights(file, tree, frames.first),
        )


def _notes(file: File, model: Model, animation: Animation | None, frames: int) -> list[str]:
    """What of the file is not drawn, or drawn in another way. ``frames``: how many are read."""
    found = []
    scenes, animations = (
        [file.entry(name, i) for i in range(len(file.all(name)))] for name in ("scenes", "animations")
    )
    left = [scene.title() for i, scene in enumerate(scenes) if i != file.head.get("scene", 0)]
    left += [entry.title() for i, entry in enumerate(animations) if i or animation is None]
    if animation is not None:
        part = f", {frames} of its {animation.count} frames" if frames < animation.count else ""
        speed = f"at {animation.rate:.4g} frames a second{part}" if animation.count > 1 else "has one key"
        found.append(f"{animation.name} {speed}")
    if left:
        found.append(f"{some(left, 5)} left out")
    materials, textures = file.all("materials"), file.head.items("textures")
    used = [materials[i] for i in model.materials if 0 <= i < len(materials)]
    if used:
        more = f" and {counted(len(textures), 'texture')}" if textures else ""
        found.append(f"{counted(len(used), 'material')}{more} left out")
    holes = sum(values.get("alphaMode") in ("MASK", "BLEND") for values in used)
    if holes:
        found.append(f"{counted(holes, 'material')} with transparency drawn opaque")
    return found
