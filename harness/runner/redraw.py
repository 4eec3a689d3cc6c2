"""A scene's picture drawn again where every point has its record but the picture is gone or damaged."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import warn
from ..results.folder import ResultsFolder
from ..scene.overrides import Lighting
from .job import Job, Options
from .protocol import LOAD_S, grade_command, load_command, picture_of, prepare_command
from .worker_process import Remote, WorkerError


def repaint(options: Options, folder: ResultsFolder, lighting: Lighting, jobs: Sequence[Job]) -> None:
    """Have a worker of its own answer the first measured point of a scene once more, untimed, and draw it.

    Nothing is done where the picture can be read. Where none can be made, that is said and nothing else is lost.
    """
    from ..report.picture import opened

    measured = [job for job in jobs if job.record is not None and job.record.status == "ok"]
    if not measured or opened(picture_of(folder, lighting, measured[0])) is not None:
        return
    job = measured[0]
    worker = Remote("picture", folder.log("picture"))
    try:
        with folder.writing():
            folder.shared_scene.parent.mkdir(parents=True, exist_ok=True)
        seconds = max(options.preset.timeout_s, LOAD_S)
        for command in (
            load_command(options, folder, lighting, job.scene, make=True),
            prepare_command(options, job),
            grade_command(options, folder, lighting, job),
        ):
            worker.ask(seconds, **command)
    except WorkerError as error:
        warn(f"{picture_of(folder, lighting, job)}: cannot be drawn ({error.reason})")
    finally:
        worker.stop()
