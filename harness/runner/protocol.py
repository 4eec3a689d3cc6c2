"""What a run asks of its workers: the commands to load a scene, to prepare a point and to grade its answers."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..files import digest
from ..results.folder import ResultsFolder
from ..scene.facts import contents
from ..scene.overrides import Lighting
from .job import Job, Options

LOAD_S = 300.0
"""Seconds a worker may take to start and to load a scene, at least: no method's doing, whatever its time limit."""


def load_command(
    options: Options, folder: ResultsFolder, lighting: Lighting, scene: str, make: bool = False
) -> dict[str, Any]:
    """What has a worker load the scene: ``make`` it, or take the one that was made."""
    preset = options.preset
    return {
        "do": "load",
        "scene": scene,
        "scene_dir": options.scene_dir,
        "frames": preset.frames,
        "width": preset.width,
        "height": preset.height,
        "shared": str(folder.shared_scene),
        "lighting": lighting.facts(),
        "make": make,
    }


def prepare_command(options: Options, job: Job) -> dict[str, Any]:
    """What has a worker prepare a point and hand its answers over."""
    preset = options.preset
    spec = {
        "key": job.point.key,
        "method": job.method,
        "settings": dict(job.point.entry.settings),
        "device": job.point.method["device"],
        "memory_limit": preset.memory,
        "maps": preset.maps,
        "budget_s": preset.budget_s,
        "runs": preset.rounds * (preset.samples + preset.stage_samples + 1),
    }
    return {"do": "prepare", "point": spec, "folder": str(options.out)}


def grade_command(options: Options, folder: ResultsFolder, lighting: Lighting, job: Job) -> dict[str, Any]:
    """What has a worker grade a job's answers, and draw its scene's picture where there is none of it."""
    return {
        "do": "grade",
        "key": job.point.key,
        "folder": str(options.out),
        "device": options.device,
        "save_answers": options.save_answers,
        "score": options.score,
        "picture": str(picture_of(folder, lighting, job)),
        # Another scene of the same name, an original for its stand-in, gets a picture of its own.
        "shows": digest(contents(job.point.scene)),
    }


def picture_of(folder: ResultsFolder, lighting: Lighting, job: Job) -> Path:
    """Where the picture of a job's scene under its lights lies."""
    return folder.image(job.point.scene["name"] + (f"-{lighting.label}" if lighting.label else ""))
