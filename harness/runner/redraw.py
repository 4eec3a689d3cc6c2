"""Draw the picture of a scene again if all of its points have records but the picture is missing or damaged."""

from __future__ import annotations

from collections.abc import Sequence

from ..errors import warn
from ..results.folder import ResultsFolder
from .planning.run_options import Job, Options
from .workers.handle import Remote, WorkerError
from .workers.protocol import LOAD_S, grade_command, load_command, picture_of, prepare_command


def repaint(options: Options, folder: ResultsFolder, jobs: Sequence[Job]) -> None:
    """Run the first measured point of a scene with one lighting again, untimed, in a separate worker, and draw it.

    Nothing is done if the picture can be read. If it cannot be drawn, a message says so.
    """
    from ..report.picture import opened

    measured = [job for job in jobs if job.record is not None and job.record.status == "ok"]
    if not measured or opened(picture_of(folder, measured[0])) is not None:
        return
    job = measured[0]
    worker = Remote("picture", folder.log("picture"))
    try:
        with folder.writing():
            folder.shared_scene().parent.mkdir(parents=True, exist_ok=True)
        seconds = max(options.preset.timeout_s, LOAD_S)
        for command in (
            load_command(options, folder, job.lighting, job.scene, make=True),
            prepare_command(options, job),
            grade_command(options, folder, job),
        ):
            worker.ask(seconds, **command)
    except WorkerError as error:
        warn(f"{picture_of(folder, job)}: cannot be drawn ({error.reason})")
    finally:
        worker.stop()
