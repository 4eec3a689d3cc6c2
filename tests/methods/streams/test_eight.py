"""Eight rays (``occlusion/on_cpu.py``) or pixels (``camera/on_cpu.py``) at once, the bits of those found
(``bits.py``), and boxes of eight triangles: what one after the other gives.
"""

import numpy as np
import pytest
import warp as wp
from helpers.launched import launched
from helpers.small_scenes import make_scene, soup
from shadowbench.harness.frame.frame import AT_ONCE, Frame
from shadowbench.harness.frame.geometry import Camera, Mesh
from shadowbench.methods.common.reads import corners_at, direction_at
from shadowbench.methods.gpu.bits import lowest_bit, without_lowest_bit
from shadowbench.methods.streams.camera.on_cpu import pixels_found, window_of
from shadowbench.methods.streams.camera.pixels import Candidate, least_edge
from shadowbench.methods.streams.camera.stream import box_of
from shadowbench.methods.streams.eight import boxes_met, boxes_of_eight
from shadowbench.methods.streams.occlusion.on_cpu import rays_found
from shadowbench.methods.streams.occlusion.planes import Occluder, certain

WIDTH, HEIGHT = 19, 7


@wp.kernel(enable_backward=False)
def found_kernel(
    rays: wp.array(dtype=wp.vec4f), planes: wp.array(dtype=wp.vec4f), camera: Camera, number: wp.int32,
    found: wp.array2d(dtype=wp.uint32),
):  # fmt: skip
    """Rows of ``found``: rays at once, rays one by one, pixels at once, pixels one by one."""
    k = wp.tid()
    o = Occluder()
    o.e0 = planes[4 * k]
    o.e1 = planes[4 * k + 1]
    o.e2 = planes[4 * k + 2]
    o.plane = planes[4 * k + 3]
    o.bound = 0.1
    o.sure = 0.2
    c = Candidate()
    c.planes.n0 = wp.vec3f(o.e0[0], o.e0[1], o.e0[2])
    c.planes.n1 = wp.vec3f(o.e1[0], o.e1[1], o.e1[2])
    c.planes.n2 = wp.vec3f(o.e2[0], o.e2[1], o.e2[2])
    c.bound = o.bound
    c.sure = o.sure
    x = k % camera.width
    y = k % camera.height
    found[0, k] = rays_found(rays, k, number, o)
    found[2, k] = pixels_found(camera, x, y, number, c)
    for i in range(wp.min(number, 8)):
        misses, hits = certain(rays[k + i], o)
        if hits:
            found[1, k] = found[1, k] | wp.uint32(1 << i)
        elif not misses:
            found[1, k] = found[1, k] | wp.uint32(256 << i)
        low = least_edge(c.planes, direction_at(camera, x + i, y))
        if low > o.sure:
            found[3, k] = found[3, k] | wp.uint32(1 << i)
        elif not (low < -o.bound):
            found[3, k] = found[3, k] | wp.uint32(256 << i)


@wp.kernel(enable_backward=False)
def boxes_kernel(
    camera: Camera, mesh: Mesh, number: wp.int32, box: wp.array(dtype=wp.vec4i), met: wp.array(dtype=wp.bool)
):
    """The box of each triangle, and whether eight at once meet the image."""
    i = wp.tid()
    first = i & ~7
    size = wp.vec2f(wp.float32(camera.width - 1), wp.float32(camera.height - 1))
    bits = boxes_met(boxes_of_eight(mesh, first, 0.0, window_of(camera)), size, True, number - first)
    met[i] = (bits >> wp.uint32(i - first) & wp.uint32(1)) != wp.uint32(0)
    box[i] = box_of(corners_at(mesh, i), camera.eye[0], camera)


@wp.kernel(enable_backward=False)
def bits_kernel(words: wp.array(dtype=wp.uint32), places: wp.array2d(dtype=wp.int32)):
    """Column by column the places of the bits that are set, and -1."""
    i = wp.tid()
    bits = words[i]
    for k in range(32):
        places[i, k] = -1
        if bits != wp.uint32(0):
            places[i, k] = lowest_bit(bits)
        bits = without_lowest_bit(bits)


def frame_of(size: float) -> Frame:
    """Triangles of a size around the eye."""
    prepared = make_scene(*soup(3, 500, size=size), [], eye=(0.1, -0.2, 0.3))
    frame = Frame(prepared, WIDTH, HEIGHT, 0, "cpu")
    frame.load(prepared.moment(0, WIDTH, HEIGHT))
    return frame


@pytest.mark.parametrize("number", [1, 5, 8, 30])
def test_eight_at_once_are_found_as_one_by_one(number: int) -> None:
    rng = np.random.default_rng(7)
    count = 200
    rays = rng.normal(size=(count + AT_ONCE, 4))
    planes = rng.normal(size=(4 * count, 4)).astype(np.float32)
    planes[:8] = np.nan  # such planes leave nothing out
    (found,) = launched(found_kernel, count, [rays, planes, frame_of(1.0).camera, number], [(4, count)])
    at_once, one_by_one, pixels_at_once, pixels_one_by_one = found
    np.testing.assert_array_equal(at_once[2:], one_by_one[2:])
    np.testing.assert_array_equal(pixels_at_once[2:], pixels_one_by_one[2:])
    assert (at_once[:2] == (256 << min(number, 8)) - 256).all()
    assert np.unique(at_once).size >= 3


def test_bits_come_from_the_lowest_on() -> None:
    words = np.array([0, 1, 2**31, 2**32 - 1, 0b101100, 0xA5A50000], dtype=np.uint32)
    (places,) = launched(bits_kernel, len(words), [words], [(len(words), 32)])
    for word, found in zip(words.tolist(), places.tolist(), strict=True):
        expected = [k for k in range(32) if word >> k & 1]
        assert found == expected + [-1] * (32 - len(expected))


@pytest.mark.parametrize("size", [0.01, 1.0, 1000.0])
def test_no_triangle_in_view_is_left_out(size: float) -> None:
    frame = frame_of(size)
    count = frame.triangle_count
    box, met = launched(boxes_kernel, count, [frame.camera, frame.mesh, count], [count, count])
    first, last = box[:, :2], box[:, 2:]
    seen = (first <= last).all(axis=1)
    assert met[seen].all()
    assert seen.any()
    assert not met.all()
