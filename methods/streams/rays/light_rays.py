"""The shadow rays of one light: what its passes share, and what its kernels are given."""

from __future__ import annotations

import functools
from dataclasses import replace
from typing import Any

import warp as wp

from ....harness.frame.effects.specialise import with_type
from ....harness.frame.frame import Frame
from ....harness.frame.geometry import filled
from ....harness.scene.effects import Effects
from ...common.bands import ThreadRanges
from ..cube.cells import RayCells, SpacedCells
from ..cube.density import spacing_arrays
from ..cube.lights import Lights
from ..queues import WORDS, Queues
from ..settings import Settings
from .hit_points import PrimaryHits


class LightRays:
    """The rays of light ``index`` of a frame.

    exact      exact hit points, vec3d [pixels], or empty
    light      :class:`..cube.lights.Light`     hits   :class:`.hit_points.PrimaryHits`
    cells      :class:`..cube.cells.RayCells`, or ``SpacedCells`` where ``spaced``
    receivers  uint8 [lights, pixels]: which hits have a ray, where not all have
    switches   the effects that the light's kernels are compiled for
    queue      the queue of each share of the triangles; counts int32 [shares, 6]: their counters
    ranges     threads of the kernels over the image
    arrays     those of the branch
    """

    def __init__(
        self,
        frame: Frame,
        index: int,
        settings: Settings,
        exact: wp.array,
        queues: Queues,
        arrays: dict[str, Any],
        lights: Lights,
        effects: Effects,
        sought: wp.array | None = None,
    ):
        """``arrays``: of :func:`..cube.cells.cell_arrays`, used by the lights of a branch in turn. ``sought``: the
        receivers that are left when the last frame's occluders were tested (:mod:`..occlusion.last_occluder`)."""
        self.frame, self.index, self.settings, self.exact = frame, index, settings, exact
        self.queues, self.lights, self.effects, self.arrays = queues, lights, effects, arrays
        self.counts = queues.counters(1 + index)
        self.queue = queues.of_stream(1 + index)
        many, few, faces = arrays["cells"]
        if any(effects.limited[index : index + 1]):
            faces = 1  # few rays do not repay clearing and summing finer cells
        self.spaced = settings.spacing == "rays"
        fields: Any = RayCells
        given = {name: array for name, array in arrays.items() if name in fields.vars}
        given |= {"cells": wp.vec3i(many, few, faces)}
        given |= {"rectangle": lights.rectangle[index], "table": lights.table[index]}
        if self.spaced:
            given |= spacing_arrays(frame.device, max(many, few))
        self.density = given.get("density", wp.empty(0, dtype=wp.float32, device=frame.device))
        self.cells: Any = filled(SpacedCells if self.spaced else RayCells, **given)
        self.shares = queues.shares if queues.threaded else 1
        self.ranges = ThreadRanges(frame, self.shares)
        self.hits: Any = filled(
            PrimaryHits, camera=frame.camera, mesh=frame.mesh, nearest=queues.nearest, exact_path=queues.exact_path
        )  # fmt: skip
        self.sought = sought
        self.receivers, self.switches = frame.receivers, effects.switches(index)
        if sought is not None:
            self.receivers, self.switches = sought, replace(self.switches, receivers=True)

    @functools.cached_property
    def light(self) -> Any:
        """Made when all passes are planned: one of them may find which triangles face the light."""
        return self.lights.light(self.index)

    def of_cells(self, kernel: wp.Kernel) -> wp.Kernel:
        """A kernel for the class of :attr:`cells`."""
        return with_type(kernel, "cells", SpacedCells) if self.spaced else kernel

    # Names of passes and resources.

    @property
    def who(self) -> str:
        return f"light {self.index}"

    @property
    def effect(self) -> str:
        return f"shadows/{self.index}"

    def name(self, what: str) -> str:
        """A resource of this light: "light aim" "ray places" "ray offsets" "ray cells" "shadowed" """
        return f"{what}/{self.index}"

    def seen(self) -> tuple[str, ...]:
        """The resources that say which pixels have a ray."""
        of_receivers = self.effects.receiver_reads(self.index)
        if self.sought is not None:
            of_receivers = (self.name("rays sought"),)
        return (WORDS, self.name("light aim"), *of_receivers)
