"""The paper's method under drawn settings of its knobs."""

from helpers.small_scenes import trace
from shadowbench.methods.perspective_spherical.parameters import (
    BALANCING,
    CLAMPS,
    DEPTH_LISTS,
    LIGHT_MAPS,
    PRECISIONS,
    SORTS,
    STAGING,
)


def answers_of(prepared, width, height, settings, device="cpu", limits=None):
    return trace("perspective_spherical", settings, prepared, width, height, device, limits)


def drawn(random, **fixed):
    """One setting of every knob that must not change an answer."""
    settings = {
        "tile": int(random.integers(1, 20)),
        "slices": int(random.integers(1, 20)),
        "light_tiles": int(random.integers(1, 100)),
        "light_slices": int(random.integers(1, 20)),
        "depth_lists": random.choice(DEPTH_LISTS),
        "light_map": random.choice(LIGHT_MAPS),
        "aimed": bool(random.integers(2)),
        "precision": random.choice(PRECISIONS),
        "clamp": random.choice(CLAMPS),
        "skip_empty": bool(random.integers(2)),
        "sort": random.choice(SORTS),
        "k": int(random.integers(1, 5)),
        "r": int(random.integers(1, 300)),
        "balancing": random.choice(BALANCING),
        "staging": random.choice(STAGING),
        "triangle_chunk": int(random.choice([0, 1, 3, 50])),
        **fixed,
    }
    if settings["precision"] == "float32-centred" and not settings["aimed"]:
        settings["precision"] = "float32"
    return {name: str(value) for name, value in settings.items()}
