"""``shadowbench plan``: list the passes that each method runs per frame of a scene, and why. Nothing is launched."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..errors import CapacityRejected, UserError, one_line
from ..frame.devices import find_device, placed_method
from ..frame.registry import make_method
from ..frame.room import fewer_that_fit
from ..frame.schedule.needed import Step, steps, wanted_of
from ..frame.schedule.passes import Pass
from ..frame.session import Session
from ..report.terminal import table_blocks, tell
from ..runner.measuring.measured_point import frame_bytes
from ..runner.measuring.memory import Memory
from ..runner.planning.experiment import Entry, parse_size
from ..scene.chosen_view import AS_IT_IS, ChosenView
from ..scene.effects import Effects
from ..scene.facts import light_facts, triangles
from ..scene.prepared import Prepared, prepare
from ..scene.scene import Scene
from ..scene.targets import numbers_of
from .answering import entries_of, require_frame
from .listing import area_text, place_text
from .options import command

if TYPE_CHECKING:
    from rich.table import Table


@command(
    """
    List the passes of each method for a scene, with reasons.
    shadowbench plan cloth --method uniform_grid

    scene  Name of a scene, or a mesh file.
    """
)
def plan(
    scene: str, method: list[str] | None = None, setting: list[str] | None = None, size: str = "256x256",
    device: str | None = None, frame: int = 0, scene_dir: Path | None = None, as_json: bool = False, *,
    view: ChosenView,
) -> int:  # fmt: skip
    """List the effects of a scene and the passes of each method, with the reason why each pass runs.

    The passes are listed for the first frame that is traced (--frame), and for a later one in which only the camera, only
    one light, only the geometry or nothing has changed.
    """
    found = frame_plan(scene, method or [], size, device, scene_dir, setting or [], view, frame)
    tell(found, as_json, show)
    return 0


def frame_plan(
    scene: str, methods: list[str], size: str = "256x256", device: str | None = None, scene_dir: Path | None = None,
    settings: Sequence[str] = (), view: ChosenView = AS_IT_IS, frame: int = 0,
) -> dict[str, Any]:  # fmt: skip
    """What the command prints, as JSON types. Raises :class:`UserError` for an unknown name, or no such ``frame``."""
    width, height = parse_size(size)
    place = find_device(device)
    entries = entries_of(methods, settings)
    described = view.resolved(scene, scene_dir)
    prepared = prepare(described)
    require_frame(prepared, frame, scene)
    effects = Effects.of(described)
    return {
        "scene": described.name, "frame": frame, "title": described.title, "stand_in": described.stand_in,
        "declared": declared(described, prepared),
        "calls_for": [*effects.names(), *(("color",) if effects.color else ())], "wanted": list(wanted_of(effects)),
        "changes": {label: sorted(changed) for label, changed in change_sets(described).items()},
        "methods": [method_plan(entry, prepared, width, height, place) for entry in entries],
    }  # fmt: skip


def declared(scene: Scene, prepared: Prepared) -> dict[str, Any]:
    """The properties of the scene, in words."""
    motion = prepared.geometry.motion
    moves = f"static over {prepared.frame_count} frames" if prepared.frame_count > 1 else "static"
    if prepared.moves:
        kind = motion.kind if motion else "deforming"
        part = "all of it"
        if motion and motion.vertices:
            part = f"vertices {motion.vertices[0]} to {motion.vertices[1] - 1}"
        moves = f"{kind} over {prepared.frame_count} frames, {part}"
    lights = []
    areas = any(light.shape for light in scene.lights)
    for light, own in zip(scene.lights, numbers_of(scene.lights), strict=True):
        words = ["directional" if light.directional else "spot" if light.spot else "area" if light.shape else "point"]
        words.append("with shadows" if light.shadows else "without shadows")
        words.append("moving" if scene.light_path is not None else "fixed")
        words.append(f"at {place_text(light.position)}{area_text(light_facts(light))}")
        if areas:
            words.append(f"passes of light {own.start}" + f" to {own[-1]}" * (len(own) > 1))
        lights.append(", ".join(words))
    return {
        "geometry": f"{triangles(prepared.triangle_count)}, {moves}",
        "declared closed": scene.closed,
        "camera": ("moving" if scene.camera_moves else "fixed") + f", from {place_text(scene.camera.eye)} to "
        f"{place_text(scene.camera.target)}",
        "lights": lights,
        "shadow rays": shadow_rays(scene),
        "alpha": scene.alpha is not None,
        "mirror bounces": scene.bounces if scene.mirror is not None else 0,
        "outputs": list(scene.outputs),
    }


def shadow_rays(scene: Scene) -> str:
    """Which receivers have a shadow ray, in words."""
    where = "where the surface faces the light" if scene.facing else "at every hit point"
    spots = any(light.spot for light in scene.lights if light.shadows)
    if spots:
        where += ", for a spotlight only inside its cone"
    if scene.facing or spots:
        where += "; the passes of a light without receivers are skipped on the device"
    return where


def change_sets(scene: Scene) -> dict[str, frozenset[str]]:
    """The inputs that changed since the last frame, by kind of frame. With a light all of its targets change."""
    lights = {f"light {i}": frozenset(f"light/{k}" for k in own) for i, own in enumerate(numbers_of(scene.lights))}
    return {"camera": frozenset({"camera"}), **lights, "geometry": frozenset({"points"}), "nothing": frozenset()}


def method_plan(entry: Entry, prepared: Prepared, width: int, height: int, device: str) -> dict[str, Any]:
    """The passes of one method and which of them run after each change; or why the method cannot trace the scene."""
    settings = dict(entry.settings)
    facts: dict[str, Any] = {"method": entry.method, "settings": settings, "cannot": None, "passes": []}
    try:
        method, place, facts["cannot"] = placed_method(entry.method, settings, prepared.scene, device)
        if facts["cannot"]:
            return facts
        tracker = Memory()
        tracker.start()
        session = Session(method, prepared, width, height, place)
        tracker.pause()
        frame = frame_bytes(session)
        facts["memory"] = {"method": max(0, tracker.peak() - frame), "frame": frame}
    except UserError:
        raise
    except CapacityRejected as error:

        def planned(fewer: Prepared) -> None:
            Session(make_method(entry.method, settings), fewer, width, height, place)

        fit = fewer_that_fit(prepared, planned)
        facts["cannot"] = f"rejected: {error}{fit}"
        return facts
    except Exception as error:  # a method may fail in any way; the others are still listed
        facts["cannot"] = f"{type(error).__name__}: {one_line(error)}"
        return facts
    after = {label: steps(session.all_passes, changed) for label, changed in change_sets(prepared.scene).items()}
    wanted = wanted_of(session.effects)
    facts["device"] = place
    facts["passes"] = [
        {
            "name": work.name, "part": work.part, "effect": work.effect, "reads": list(work.reads),
            "writes": list(work.writes), "first": first_reason(work, session.all_passes, wanted),
            "after": {label: verdict(rows[k]) for label, rows in after.items()},
        }
        for k, work in enumerate(session.all_passes)
    ]  # fmt: skip
    kept = set(session.all_passes)
    facts["left_out"] = [work.name for work in session.planned if work not in kept]
    return facts


def verdict(step: Step) -> dict[str, Any]:
    """Whether a pass runs, and why."""
    return {"runs": step.runs, "reason": step.reason}


def first_reason(work: Pass, passes: list[Pass], wanted: tuple[str, ...]) -> str:
    """Why a pass runs in the first frame: its output is requested, or another pass reads it."""
    for name in work.writes:
        if name in wanted:
            return f"output {name}"
    later = passes[passes.index(work) + 1 :]
    reader = next((other for other in later if set(other.reads) & set(work.writes)), None)
    return f'read by "{reader.name}"' if reader else "written together with an output"


def show(found: dict[str, Any]) -> None:
    """Print one table per method, as wide as the terminal, with the reason why each pass runs."""
    from rich.console import Console
    from rich.padding import Padding

    console = Console(markup=False, highlight=False, emoji=False)
    console.print(f"{found['title']}  ({found['scene']}, frame {found['frame']})")
    facts = {key: value for key, value in found["declared"].items() if key != "lights"}
    facts |= {f"light {i}": words for i, words in enumerate(found["declared"]["lights"])}
    facts["calls for"] = found["calls_for"] or "primary rays alone"
    if found["stand_in"]:
        console.print(f"  {found['stand_in']}")
    for key, value in facts.items():
        if isinstance(value, bool):
            value = "yes" if value else "no"
        console.print(
            Padding(f"{key}: {', '.join(value) if isinstance(value, list) else value}", (0, 0, 0, 2), expand=False)
        )
    console.print(
        "\nThe columns after the first frame are later frames in which only the named input has changed. A cell names what "
        "the pass reads that is new; in brackets, what it writes together with another pass that runs. A dot: the pass "
        "does not run."
    )
    for method in found["methods"]:
        console.print()
        if method["cannot"]:
            console.print(f"{_called(method)}: cannot: {method['cannot']}")
            continue
        held = ", ".join(f"{name} {count / 1e6:,.1f} MB" for name, count in method["memory"].items())
        console.print(f"{_called(method)} on {method['device']}; memory as planned: {held}")
        for k, table in enumerate(_tables(method, list(found["changes"]), console.width)):
            if k:
                console.print()
            console.print(table)
        if method["left_out"]:
            console.print(f"  left out, because nothing reads their output: {', '.join(method['left_out'])}")


def _tables(method: dict[str, Any], changes: list[str], width: int) -> list[Table]:
    passes = method["passes"]
    rows = [[work["name"], work["first"], *(_cause(work["after"][label]) for label in changes)] for work in passes]
    runs = [sum(work["after"][label]["runs"] for work in passes) for label in changes]
    rows.append(["passes that run", str(len(passes)), *map(str, runs)])
    return table_blocks(["pass", "first frame", *changes], rows, width)


def _called(method: dict[str, Any]) -> str:
    """A method's name with its settings."""
    given = ", ".join(f"{key}={value}" for key, value in method["settings"].items())
    return f"{method['method']} ({given})" if given else method["method"]


def _cause(verdict: dict[str, Any]) -> str:
    """What makes a pass run, in one or two words; in brackets a resource that another pass writes, too."""
    reason = verdict["reason"]
    if not verdict["runs"]:
        return "."
    written = reason.removesuffix(" is written again")
    return f"({written})" if written != reason else reason.removesuffix(" changed")
