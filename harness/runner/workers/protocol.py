"""The commands that a run sends to its workers: load a scene, prepare a point, score its answers; and what they reply.
Paths are named from the root: a method may change the folder that its process works in.
"""

from pathlib import Path
from typing import Annotated, Any, TypedDict

from ...files import digest, require_storable
from ...results.folder import ResultsFolder, image_name
from ...results.journal import Finished, Prepared, Sampled
from ...results.record import SceneFacts
from ...scene.facts import contents
from ...scene.overrides import Lighting
from ...typed_json import checked
from ..planning.planned_point import Job, Options

UNWRITABLE = "unwritable"  # a worker's reply, as a status, where it could not write to the results folder


def load_command(
    options: Options, folder: ResultsFolder, lighting: Lighting, scene: str, make: bool = False
) -> dict[str, Any]:
    """The command to load the scene: ``make`` it, or read the one that another worker has made."""
    preset = options.preset
    return {
        "do": "load", "scene": scene, "scene_dir": options.scene_dir, "frames": preset.frames, "width": preset.width,
        "height": preset.height, "shared": str(folder.shared_scene(lighting.frames).absolute()),
        "lighting": lighting.facts(), "make": make,
        **({"view": options.view.facts()} if options.view.changes else {}),
    }  # fmt: skip


def prepare_command(options: Options, job: Job, answers: bool = True) -> dict[str, Any]:
    """The command to prepare a point; with ``answers``, also to hand over its answers."""
    preset = options.preset
    spec = {
        "key": job.point.key, "method": job.method, "settings": dict(job.point.entry.settings),
        "device": job.point.method["device"], "memory_limit": preset.memory, "maps": preset.maps,
        "costs_s": preset.costs_s, "budget_s": preset.budget_s,
        "runs": preset.rounds * (preset.samples + preset.stage_samples + 1),
    }  # fmt: skip
    about = {"folder": str(options.out.absolute()), "light": job.lighting.label, "answers": answers}
    return {"do": "prepare", "point": spec, **about}


def grade_command(options: Options, folder: ResultsFolder, job: Job, device: str) -> dict[str, Any]:
    """The command to score the answers of a job on a device, and to draw the picture of its scene if there is none."""
    return {
        "do": "grade",
        "key": job.point.key,
        "folder": str(options.out.absolute()),
        "device": device,
        "save_answers": options.save_answers,
        "score": options.score,
        "wrong_maps": options.preset.wrong_maps,
        "picture": str(picture_of(folder, job).absolute()),
        # Another scene of the same name (an original instead of its stand-in) is drawn again.
        "shows": digest(contents(job.point.scene)),
    }


def picture_of(folder: ResultsFolder, job: Job) -> Path:
    """The file of the picture of a job's scene with its lights, at its size."""
    preset = job.point.preset
    name = image_name(job.point.scene["name"], job.lighting.label, preset.width, preset.height)
    return folder.path / "images" / name


class _Loaded(TypedDict):
    scene: SceneFacts
    load_s: Annotated[float, 0.0]


class _Room(TypedDict):
    room: float


class _Prepared(Prepared, _Room):
    answers: str


class _Scored(Finished):
    compile_s: Annotated[float, 0.0]


REPLIES: dict[str, type] = {"load": _Loaded, "prepare": _Prepared, "round": Sampled, "grade": _Scored, "free": _Room}
"""The schema of the reply to each command."""


def check_reply(command: str, reply: dict[str, Any]) -> None:
    """Raise ValueError, which names the field, if a reply has another shape, or holds what no record can hold."""
    try:
        checked(REPLIES[command], reply)
        require_storable(reply)
    except OverflowError as error:
        raise ValueError(f"a number is too large ({error})") from error
