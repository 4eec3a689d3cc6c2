"""The worker processes of a run: what each has loaded, and which prepared points they hold in memory. The points of a
scene are measured in turn, whatever their method and lighting, so each worker keeps its points prepared. Where memory
gets short, the points that were not used for longest are freed, and prepared again when their turn comes.
"""

from collections.abc import Sequence
from typing import Any

from ...results.folder import ResultsFolder
from ...scene.overrides import Lighting
from ..machine.lock import MACHINE
from ..planning.planned_point import Job, Options
from .handle import Remote, WorkerError
from .protocol import UNWRITABLE, grade_command, load_command, prepare_command

LOAD_S = 300.0  # least time limit for a worker to start and load a scene, whatever the method's limit, seconds
ROOM = 0.2  # share of the memory of the device, and of the host, that is kept free by freeing other points


def grader_name(number: int) -> str:
    """The names of the workers that score answers, from 1. No method has a dot in its name."""
    return f"grading.{number}"


def grades(name: str) -> bool:
    """Whether this is the name of a worker that scores answers."""
    return "." in name


GRADER = grader_name(1)  # the one that also makes the scenes


class Workers:
    """The workers by name: a method's, or :data:`GRADER`. ``options``: of the presets under way; ``apart``: the processors
    that only scoring has.
    """

    def __init__(self, folder: ResultsFolder, options: Options, apart: Sequence[int] = ()):
        self.folder, self.options, self.apart = folder, options, apart
        self._remotes: dict[str, Remote] = {}
        self._loaded: dict[tuple[str, str], int] = {}
        """The generation of the worker that has loaded a lighting, by worker and label."""
        self._held: dict[Job, None] = {}
        """Jobs that are prepared, the one that was not used for longest first."""

    def get(self, name: str) -> Remote:
        """A worker, which starts with its first command."""
        if name not in self._remotes:
            self._remotes[name] = Remote(name, self.folder.log(name), self.apart if grades(name) else ())
        return self._remotes[name]

    # --- commands ---

    def command(self, worker: Remote, **command: Any) -> dict[str, Any]:
        self.send(worker, **command)
        return self.reply(worker)

    def send(self, worker: Remote, **command: Any) -> None:
        """Send a command. It runs under the machine lock of this process, else under the worker's, unless it is apart."""
        with self.folder.writing():
            worker.send(**command, share=not (MACHINE.held or worker.apart))

    def score(self, name: str, job: Job) -> None:
        """Have a worker score the answers that the method's worker handed over when a job was prepared."""
        device = "cpu" if self.apart else self.options.device
        self.send(self.get(name), **grade_command(self.options, self.folder, job, device))

    def reply(self, worker: Remote) -> dict[str, Any]:
        """The reply to the command sent last. Raises :class:`~.errors.UserError` if the folder cannot be written."""
        timeout = self.options.preset.timeout_s
        try:
            return worker.receive(max(timeout, LOAD_S) if worker.command == "load" else timeout)
        except WorkerError as error:
            if error.status == UNWRITABLE:
                raise self.folder.unwritable(error.reason) from error
            raise

    def _tell(self, worker: Remote, **command: Any) -> dict[str, Any]:
        """Send a command whose failure affects no point: the worker is stopped if it fails. Its reply, or nothing."""
        if not worker.running:
            return {}
        try:
            return self.command(worker, **command)
        except WorkerError:
            worker.stop()
            return {}

    # --- scenes ---

    def make(self, scene: str, lighting: Lighting, methods: set[str]) -> tuple[dict[str, Any], dict[str, WorkerError]]:
        """Have the grader make a scene, and the workers of ``methods`` read it: its facts, and the workers that failed.
        Raises :class:`WorkerError` if it cannot be made.
        """
        with self.folder.writing():
            self.folder.shared_scene().parent.mkdir(parents=True, exist_ok=True)
        self._ask_to_load(GRADER, scene, lighting, make=True)
        made, lost = self._loads(GRADER, lighting), {}
        for method in sorted(methods):
            self._ask_to_load(method, scene, lighting)
        for method in sorted(methods):
            try:
                self._loads(method, lighting)
            except WorkerError as error:
                lost[method] = error
        return {**made["scene"], "load_s": made["load_s"]}, lost

    def ensure_loaded(self, name: str, job: Job) -> None:
        """Have a worker load the scene of a job with its lighting, unless it has."""
        worker = self.get(name)
        if not worker.running or self._loaded.get((name, job.lighting.label)) != worker.generation:
            self._ask_to_load(name, job.scene, job.lighting)
            self._loads(name, job.lighting)

    def _ask_to_load(self, name: str, scene: str, lighting: Lighting, make: bool = False) -> None:
        """A grader scores one lighting after another and forgets the one before; a method's worker measures all in turn."""
        alone = grades(name)
        if alone:
            self._loaded = {known: start for known, start in self._loaded.items() if known[0] != name}
        self.send(self.get(name), **load_command(self.options, self.folder, lighting, scene, make), alone=alone)

    def _loads(self, name: str, lighting: Lighting) -> dict[str, Any]:
        reply = self.reply(self.get(name))
        self._loaded[name, lighting.label] = self.get(name).generation
        return reply

    # --- points ---

    def prepare(self, job: Job, answers: bool) -> dict[str, Any] | None:
        """Have a job's worker prepare it, unless it has: what there is to note, or None. ``answers``: hand them over."""
        worker = self.get(job.method)
        if worker.running and worker.generation == job.generation:
            self._held[job] = self._held.pop(job, None)
            return None
        self.ensure_loaded(job.method, job)
        reply = self.command(worker, **prepare_command(self.options, job, answers))
        job.generation, job.answers = worker.generation, reply.pop("answers")
        self._held[job] = None
        room = reply.pop("room")
        for other in [one for one in self._held if one is not job]:
            if room < ROOM:
                room = self.free(other).get("room", room)
        return reply

    def free(self, job: Job) -> dict[str, Any]:
        """Free a point, and its lighting where its worker holds no other point with that; its worker's reply, if any."""
        self._held.pop(job, None)
        job.generation = 0
        place, light = (job.method, job.lighting.label), None
        if all((one.method, one.lighting.label) != place for one in self._held):
            self._loaded.pop(place, None)
            light = job.lighting.label
        return self._tell(self.get(job.method), do="free", key=job.point.key, light=light)

    def clear(self) -> None:
        self._held.clear()
        self._loaded.clear()
        for worker in self._remotes.values():
            self._tell(worker, do="free")

    def stop(self) -> None:
        for worker in self._remotes.values():
            worker.end()
        for worker in self._remotes.values():
            worker.stop()
        for path in (self.folder.path / "journal").glob("scene-*.npz"):
            if path.stem.removeprefix("scene-").isdecimal():
                path.unlink(missing_ok=True)
