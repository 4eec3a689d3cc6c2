"""Files that go from a results folder to a worker and back; they are stored as a run on one machine stores them."""

from __future__ import annotations

import json
from pathlib import Path

from ...errors import UserError
from ...files import write_atomic, write_bytes
from ...results.folder import ResultsFolder, image_name, read_json
from ...results.record import Record, make_record
from ...results.schema import read_record, read_records
from ..planning.planned_point import describe_method, make_point
from ..planning.run_options import Options
from ..scene_cache import known_scene
from ..unmade_scenes import forget_unmade, is_unmade, unmade_scene
from ..workers.protocol import load_command
from .shard import Outcome
from .spool import Files, allowed

SCENES = "scenes.json"


class Delivery:
    """Files in and out of the results folder of a run on a cluster."""

    def __init__(self, folder: ResultsFolder, options: Options):
        self.folder, self.options = folder, options

    def known(self, options: Options) -> Files:
        """The files of the folder that concern a shard: its records, its pictures, and the facts of scenes."""
        preset = options.preset
        try:
            scene = options.described(preset.scenes[0]).name
        except UserError:
            return {}  # the worker reports what is wrong with the scene
        place, found = self.folder.path, {}
        try:
            records = read_records(place)
        except UserError:
            records = []  # there is no record yet, or the file is invalid and the point is measured again
        for record in records:
            size = (record.point["width"], record.point["height"])
            if record.scene["name"] == scene and size == (preset.width, preset.height):
                found[f"records/{record.key}.json"] = self._content(record)
        for lighting in preset.lightings:
            name = image_name(scene, lighting.label, preset.width, preset.height)
            if (place / "images" / name).is_file():
                found[f"images/{name}"] = (place / "images" / name).read_bytes()
        if (place / SCENES).is_file():
            found[SCENES] = (place / SCENES).read_bytes()
        return found

    def _content(self, record: Record) -> bytes:
        path = self.folder.path / "records" / f"{record.key}.json"
        if path.is_file():
            return path.read_bytes()
        return (json.dumps(record.to_json(), indent=1, allow_nan=False) + "\n").encode()

    def write(self, outcome: Outcome) -> list[Record]:
        """Write what a worker delivers, records last, so that a record has its files. Returns the new records.

        A record is checked by the schema before it is stored; storing it removes a journal that an earlier run left.
        """
        new: list[Record] = []
        with self.folder.writing():
            for name, content in outcome.files.items():
                if not allowed(name):
                    raise UserError(f"{name}: a worker delivered a file of this name, which no results folder has")
                path = self.folder.path / name
                if name == SCENES:
                    write_atomic(path, {**(read_json(path) or {}), **json.loads(content)})
                elif not name.startswith("records/"):
                    write_bytes(path, content)
            for name, content in outcome.files.items():
                if name.startswith("records/"):
                    new.append(self._keep(self.folder.path / name, content))
        forget_unmade(self.folder, [(one.key, one.method.get("label")) for one in new if not is_unmade(one)])
        return new

    def _keep(self, path: Path, content: bytes) -> Record:
        arriving = path.with_name(f".{path.name}.arriving")
        write_bytes(arriving, content)
        try:
            record = read_record(arriving)
        finally:
            arriving.unlink(missing_ok=True)
        self.folder.keep_record(record, self.folder.journal(record.key))
        return record

    def failed(self, options: Options, device: tuple[str, str], reason: str) -> list[Record]:
        """Records for the points of a shard that no worker could finish. Records that are there stay."""
        preset, records = options.preset, []
        (name,) = preset.scenes
        for lighting in preset.lightings:
            command = load_command(options, self.folder, lighting, name)
            try:
                facts = known_scene(self.folder, command)
            except UserError:
                facts = None
            for entry in preset.methods:
                method = describe_method(entry, "cpu")
                if device[0] != "cpu" and not method.get("broken"):
                    method = {**method, "device": device[0], "asked_device": device[0], "device_name": device[1]}
                scene = facts or unmade_scene(options, name, lighting)
                point = make_point(options.experiment.name, preset, entry, scene, method, options.seed)
                kept = self.folder.record(point.key)
                if kept is None:
                    described = {**point.configuration, "preset": options.preset_name}
                    made_of = (point.key, described, point.scene, point.method, "")
                    kept = make_record(*made_of, status="failed", reason=reason)
                    self.folder.keep_record(kept, self.folder.journal(point.key))
                records.append(kept)
        return records
