"""The process of one version for ``versions.py``: ``version_worker.py FOLDER DEVICE`` with the package of FOLDER.

Reads requests as lines of JSON: {"method", "settings", "scene", "samples"}, the scene as ``versions.py`` takes it. The reply
is {"ms": samples of the whole frame, "answers": a hash of their bits}, or {"error": a line}.
"""

import hashlib
import json
import os
import sys
from pathlib import Path
from typing import Any

replies = os.fdopen(os.dup(1), "w")
os.dup2(2, 1)  # what is printed while kernels are compiled is no reply

sys.path.append(str(Path(__file__).resolve().parents[1]))  # the tests' helpers

from helpers.asked_scene import AskedScene
from shadowbench.harness import api
from shadowbench.harness.scene.overrides import Lighting

try:
    from shadowbench.harness.runner.measuring.timing import Sampling, sample_frame
except ModuleNotFoundError:  # version 0.1
    from shadowbench.harness.runner.timing import Sampling, sample_frame

SIDE = 1024


class Frames:
    """Frames that are ready to be timed, each made once."""

    def __init__(self, device: str | None) -> None:
        self.device = api.find_device(device)
        self._prepared: dict[tuple[str, Lighting], Any] = {}
        self._ready: dict[str, tuple[api.Session, str]] = {}

    def prepared(self, asked: AskedScene) -> Any:
        key = (asked.name, asked.lighting)
        if key not in self._prepared:
            self._prepared[key] = asked.prepared()
        return self._prepared[key]

    def ready(self, method: str, settings: dict[str, str], scene: str) -> tuple[api.Session, str]:
        """The session with the frame in it, and a hash of its answers."""
        key = json.dumps([method, settings, scene])
        if key not in self._ready:
            asked = AskedScene.read(scene, SIDE)
            prepared = self.prepared(asked)
            session = api.Session(api.make_method(method, settings), prepared, asked.side, asked.side, self.device)
            frame = prepared.frame_count // 2 if asked.frame is None else asked.frame
            answers = session.answers(prepared.moment(frame, asked.side, asked.side))
            found = hashlib.sha256()
            for name in sorted(answers, key=lambda name: name.replace("visibility", "shadowed")):  # 0.1's name
                found.update(answers[name].tobytes())
            self._ready[key] = session, found.hexdigest()
        return self._ready[key]

    def reply(self, method: str, settings: dict[str, str], scene: str, samples: int) -> dict[str, Any]:
        session, answers = self.ready(method, settings, scene)
        sampling = Sampling(samples=samples, most=samples, stage_samples=0, budget_s=60.0)
        return {"ms": sample_frame(session, sampling).total_ms if samples else [], "answers": answers}


def main() -> None:
    folder, device = sys.argv[1:]
    if not Path(api.__file__).is_relative_to(folder):
        sys.exit(f"another package comes before that of {folder}: {api.__file__}")
    frames = Frames(device or None)
    for line in sys.stdin:
        try:
            reply = frames.reply(**json.loads(line))
        except Exception as error:  # whatever an older version raises
            reply = {"error": f"{type(error).__name__}: {error}".splitlines()[0]}
        print(json.dumps(reply), file=replies, flush=True)


if __name__ == "__main__":
    main()
