"""glTF extensions: which are understood, which never change what is drawn, and which are refused by name.

An extension that is not understood may move, add or hide triangles. It is refused where the file requires it, and where it
stands at something that is read. One of a material, a texture or an image only changes how a surface looks.
"""

import re

from .compressed import DRACO, MESHOPT
from .document import Document, Entry

UNDERSTOOD = frozenset(
    {
        "EXT_mesh_gpu_instancing",
        "KHR_animation_pointer",
        "KHR_lights_punctual",
        "KHR_mesh_quantization",
        "KHR_node_visibility",
        DRACO,
        *MESHOPT,
    }
)

_LOOKS = re.compile(r"[A-Z0-9]+_(materials|texture|textures|lights|image)_.+")
"""Extensions of how surfaces look and are lit."""

_NOT_DRAWN = frozenset(
    """
    AGI_articulations AGI_stk_metadata CESIUM_primitive_outline EXT_feature_metadata EXT_instance_features EXT_mesh_features
    EXT_mesh_manifold EXT_structural_metadata FB_geometry_metadata FB_ngon_encoding GODOT_single_root KHR_audio
    KHR_audio_emitter KHR_collision_shapes KHR_implicit_shapes KHR_interactivity KHR_node_hoverability
    KHR_node_selectability KHR_physics_rigid_bodies KHR_xmp KHR_xmp_json_ld MOZ_hubs_components MSFT_audio_emitter MSFT_lod
    MSFT_packing_normalRoughnessMetallic MSFT_packing_occlusionRoughnessMetallic OMI_collider OMI_physics_body
    OMI_physics_joint OMI_physics_shape VRM VRMC_node_constraint VRMC_springBone VRMC_vrm VRMC_vrm_animation
    """.split()
)
"""Extensions that describe a file, or what may happen after it is first drawn. Of MSFT_lod the finest meshes are drawn."""


def harmless(name: str) -> bool:
    """Whether an extension that is not understood leaves the triangles as they are."""
    return name in _NOT_DRAWN or _LOOKS.fullmatch(name) is not None


def refuse_required(document: Document) -> None:
    """Raise :class:`UserError` if the file requires an extension that is not understood, or one of its root is not."""
    for name in document.items(document.head, "extensionsRequired", "the file"):
        if not isinstance(name, str) or not (name in UNDERSTOOD or harmless(name)):
            raise document.error(f"needs the extension {name}", "export it without")
    refuse_unknown(document, document.head, "the file")


def refuse_unknown(document: Document, entry: Entry, where: str) -> None:
    """Raise :class:`UserError` if an extension of an entry that is read may change what is drawn."""
    if "extensions" not in entry:
        return
    for name in document.object(entry, "extensions", where):
        if not (name in UNDERSTOOD or harmless(name)):
            problem = f"{where} has the extension {name}, which may change its triangles and cannot be read"
            raise document.error(problem, "export it without")
