"""Random closed surfaces that touch, cross and turn inside out, on a lattice that rays meet: no bit changes when what faces
away from a light is left out. Without the check of what forbids it, bits do.
"""

from collections.abc import Iterator

import numpy as np
from shadowbench.harness.frame.registry import make_method
from shadowbench.harness.frame.session import Session
from shadowbench.harness.hardcases.case import Trial, view
from shadowbench.harness.hardcases.closed_parts import welded
from shadowbench.harness.hardcases.shapes import Mesh, box, icosphere, joined, plane, split
from shadowbench.methods.streams.method import StreamedMethod
from shadowbench.methods.streams.queues import more_room

SCENES = 80
QUARTERS = 4.0
"""Coordinates are multiples of a quarter; rays meet the plane z = 0 in odd multiples."""


def surface(random: np.random.Generator) -> Mesh:
    """A closed surface: a box, a double cone, a ball whose vertices lie anywhere, or two sides of one square; perhaps
    wound inward, perhaps with a triangle missing.
    """

    def lattice(*shape: int) -> np.ndarray:
        return random.integers(-8, 9, shape) / QUARTERS

    kind = random.integers(0, 5)
    if kind == 0:
        low = lattice(3)
        points, faces = box(low, low + random.integers(1, 8, 3) / QUARTERS)
    elif kind == 1:
        points, faces = icosphere(1)
        points = points * random.uniform(0.2, 1.5) * random.uniform(0.7, 1.3, (len(points), 1)) + lattice(3)
    elif kind == 2:
        points, faces = lattice(12, 3), icosphere(0)[1]
    elif kind == 3:
        count = int(random.integers(3, 7))
        around = [(k, (k + 1) % count) for k in range(count)]
        points = lattice(count + 2, 3)
        faces = np.array([f for a, b in around for f in ((a, b, count), (b, a, count + 1))])
    else:
        points, faces = lattice(4, 3), np.array([(0, 1, 2), (0, 2, 3), (1, 0, 3), (1, 3, 2)])
        points[3] = points[0] + points[2] - points[1]
    if random.random() < 0.35:
        faces = faces[:, ::-1]
    if random.random() < 0.1:
        faces = faces[1:]
    return points, faces


def scenes() -> Iterator[Trial]:
    """Scenes of one to five surfaces, with and without welded vertices, before or after a floor in their indices."""
    for seed in range(SCENES):
        random = np.random.default_rng(seed)
        solid = joined(*(surface(random) for _ in range(random.integers(1, 6))))
        solid = (welded(*solid), split(solid), solid)[random.integers(0, 3)]
        floor = plane(2, random.integers(-16, 1) / QUARTERS, 8.0)
        mesh = joined(floor, solid) if random.random() < 0.5 else joined(solid, floor)
        lights = random.integers(-16, 17, (3, 3)) / QUARTERS
        across = random.integers(-8, 9, 2) / QUARTERS
        yield view(mesh, lights.tolist(), (*across.tolist(), 8.0), (0, 0, -1), 0.5)


def bits(trial: Trial, closed: str) -> tuple[np.ndarray, Session]:
    session = Session(make_method("ray_grids", {"closed": closed, "threads": "1"}), trial.prepared, 16, 16, "cpu")
    return session.answers(trial.moment)["shadowed"], session


def differing() -> tuple[int, int, int]:
    """Scenes in which bits differ, in which surfaces were left closed, and in which some were opened."""
    differ = closed = opened = 0
    for trial in scenes():
        found, session = bits(trial, "true")
        differ += not np.array_equal(found, bits(trial, "false")[0])
        closed += session.effects.closed
        opened += session.regrown > 0
    return differ, closed, opened


def test_no_bit_changes_when_what_faces_away_is_left_out():
    differ, closed, opened = differing()
    assert differ == 0
    assert closed > SCENES // 2
    assert opened > SCENES // 8


def test_bits_change_where_nothing_is_opened(monkeypatch):
    def grow(self, needed):
        before, self._capacity = self._capacity, more_room(needed, self._capacity, self._memory)
        return self._capacity != before

    monkeypatch.setattr(StreamedMethod, "grow", grow)
    assert differing()[0] > 0
