"""Back-face culling: legal on closed surfaces seen from outside, refused where it would lose hits."""

from __future__ import annotations

import dataclasses

import numpy as np
from brute_force import make_scene
from shadowbench.harness.registry import make_method
from test_paper_knobs import answers_of, grid_of_squares, same


def test_culling_changes_nothing_but_ties_on_a_closed_surface_seen_from_outside():
    vertices, faces = grid_of_squares(5)
    for wound in (faces, faces[:, ::-1]):  # inward or outward, as long as it is consistent
        both = np.concatenate([vertices, vertices * 0.5 + [1.9, 0.4, 0.2]])
        prepared = make_scene(
            both, np.concatenate([wound, wound + len(vertices)]), [(4.0, 5.0, 6.0)], (2.0, 3.0, 7.0)
        )
        scene = dataclasses.replace(prepared.scene, closed=True)
        _, _, off = answers_of(prepared, 61, 47, {})
        pairs = []
        for cull in ("off", "primary", "primary+light"):
            method = make_method("perspective_spherical", {"cull": cull})
            assert method.applies(scene, "cpu") is None
            session, _, got = answers_of(prepared, 61, 47, {"cull": cull})
            same(got, off, cull)
            counts = session.method.counters()
            pairs.append((counts["camera pairs"], counts["light 0 pairs"]))
        assert pairs[1][0] < pairs[0][0]
        assert pairs[2][1] < pairs[1][1]


def test_culling_is_refused_where_it_would_lose_hits():
    vertices, faces = grid_of_squares(2)
    outside, within = (0.0, 0.0, 7.0), (0.1, 0.2, 0.3)

    def reason(cull, eye, light, closed):
        prepared = make_scene(vertices, faces, [light], eye, (5.0, 1.0, 1.0))
        scene = dataclasses.replace(prepared.scene, closed=closed)
        return make_method("perspective_spherical", {"cull": cull}).applies(scene, "cpu")

    assert reason("primary", outside, outside, True) is None
    assert reason("primary", outside, within, True) is None
    assert "declared closed" in reason("primary", outside, outside, False)
    assert "eye outside" in reason("primary", within, outside, True)
    assert "light outside" in reason("primary+light", outside, within, True)
    assert reason("off", within, within, False) is None
