"""glTF files of many kinds of entries: a skinned square, compressed points, and one with all that is read."""

import DracoPy
import meshopt
import numpy as np

from .gltf_files import CORNERS, SQUARE, Gltf, square

DRACO = "KHR_draco_mesh_compression"

POINTS = np.random.default_rng(5).random((50, 3)).astype("f4")
FACES = np.random.default_rng(6).permutation(np.arange(150) % 50).astype("u4")


def draco(points: np.ndarray, corners: np.ndarray, **attributes: np.ndarray) -> Gltf:
    """A file of one mesh that is compressed without loss of order."""
    made = Gltf()
    packed = DracoPy.encode(
        points,
        corners.reshape(-1, 3),
        quantization_bits=24,
        preserve_order=True,
        generic_attributes={i: values for i, values in enumerate(attributes.values())} or None,
    )
    ids = {a["attribute_type"]: a["unique_id"] for a in DracoPy.decode(packed).attributes}
    named = {"POSITION": ids[0], **{name: i for i, name in enumerate(attributes)}}
    made.node(mesh=made.mesh(points, corners))
    for name, values in attributes.items():
        made.primitive()["attributes"][name] = made.accessor(values, values.dtype.str[1:])
    for accessor in made.head["accessors"]:
        accessor.pop("bufferView")
    made.data.clear()
    made.head["bufferViews"] = []
    said = {"bufferView": made.view(packed), "attributes": named}
    made.extend(made.primitive(), DRACO, said, required=True)
    return made


def packed(points: np.ndarray, corners: np.ndarray, name: str = "EXT_meshopt_compression") -> Gltf:
    """A file of one square whose buffer views are compressed by meshoptimizer, with an empty buffer to fall back on."""
    made = square()
    made.head["accessors"][0]["count"], made.head["accessors"][1]["count"] = len(points), len(corners)
    made.head["accessors"][1]["componentType"] = 5125
    plain = [(points, "ATTRIBUTES"), (corners, "TRIANGLES")]
    made.data.clear()
    made.head["bufferViews"], made.head["buffers"] = [], [{}, {"byteLength": 1 << 20}]
    made.extend(made.head["buffers"][1], name, {"fallback": True}, required=True)
    for values, mode in plain:
        stride = values.nbytes // len(values)
        view = made.view(meshopt.encode_gltf_buffer(values, mode))
        said = {**made.head["bufferViews"][view], "byteStride": stride, "count": len(values), "mode": mode}
        made.head["bufferViews"][view] = {
            "buffer": 1,
            "byteOffset": 1 << 15,
            "byteLength": values.nbytes,
            "extensions": {name: said},
        }
    return made


def skinned(points=SQUARE, influences=1) -> Gltf:
    """A square between two joints, one above the other; its own node is far away, which means nothing."""
    rng = np.random.default_rng(4)
    made = Gltf()
    joints, weights = (rng.integers(0, 2, (influences, len(points), 4)), rng.random((influences, len(points), 4)))
    attributes = {}
    for i in range(influences):
        attributes[f"JOINTS_{i}"] = made.accessor(joints[i], "u1")
        attributes[f"WEIGHTS_{i}"] = made.accessor(weights[i])
    mesh = made.mesh(points, CORNERS, attributes=attributes)
    first = made.node(translation=[0, 1, 0])
    second = made.node(first, rotation=[0, 0, 0.6, 0.8])
    inverse = rng.normal(size=(2, 4, 4))
    inverse[:, 3] = [0, 0, 0, 1]
    made.add(
        "skins",
        {"joints": [second, first], "inverseBindMatrices": made.accessor(inverse.transpose(0, 2, 1).reshape(2, 16))},
    )
    made.node(mesh=mesh, skin=0, translation=[1000, 0, 0], scale=[-1, 1, 1])
    return made


def everything() -> Gltf:
    """A file with all that is read: every kind of accessor, primitive, node, animation, camera and light."""
    made = skinned()
    rng = np.random.default_rng(7)
    target = made.sparse(4, 2, [0, 0, 5])
    made.primitive()["targets"] = [{"POSITION": target}]
    small = made.accessor(rng.integers(-100, 100, (4, 4)), "i1", type="VEC3", normalized=True)
    made.head["bufferViews"][-1]["byteStride"] = 4
    strip = {"attributes": {"POSITION": small}, "mode": 5, "material": 0}
    lines = {"attributes": {"POSITION": small}, "mode": 1}
    fan = {"attributes": {"POSITION": small}, "mode": 6, "indices": made.accessor(np.arange(4), "u1")}
    mesh = made.add("meshes", {"primitives": [strip, lines, fan]})
    node = made.node(mesh=mesh, matrix=np.diag([1, -1, 1, 1]).ravel().tolist(), camera=0)
    places = made.accessor(rng.random((3, 3)))
    made.extend(made.head["nodes"][node], "EXT_mesh_gpu_instancing", {"attributes": {"TRANSLATION": places}})
    made.extend(made.head["nodes"][node], "KHR_node_visibility", {"visible": True})
    made.extend(made.head["nodes"][node], "KHR_lights_punctual", {"light": 0})
    made.extend(made.head, "KHR_lights_punctual", {"lights": [{"type": "spot", "spot": {"outerConeAngle": 0.5}}]})
    made.add("cameras", {"type": "perspective", "perspective": {"yfov": 1.0, "znear": 0.1}})
    made.add("materials", {"alphaMode": "BLEND", "name": "glass"})
    made.head["scenes"].append({"nodes": [0], "name": "other"})
    made.animate(
        translation=(0, [0, 0.2], rng.random((2, 3)), "STEP"),
        rotation=(1, [0, 0.1], rng.random((2, 4))),
        scale=(0, [0, 0.1], rng.random((6, 3)), "CUBICSPLINE"),
        weights=(2, [0, 0.2], [0, 1]),
    )
    return made


def moved(**channels) -> Gltf:
    """A square whose node moves: for each path times and values, and perhaps the interpolation."""
    made = square()
    made.animate(**{path: (0, *curve) for path, curve in channels.items()})
    return made


def instanced(attributes: dict[str, object], **node: object) -> Gltf:
    """A square in many instances, of an array for each attribute."""
    made = square(**node)
    said = {"attributes": {name: made.accessor(values) for name, values in attributes.items()}}
    made.extend(made.head["nodes"][0], "EXT_mesh_gpu_instancing", said)
    return made
