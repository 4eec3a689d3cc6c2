"""The experiments, one file for each: what to run, and how to draw it."""

INTEREST = (  # those that a reader asks for first, in this order; others follow by name
    "frame_time", "crossover", "scaling", "moving", "two_lights", "soft_shadows", "accuracy", "effects", "reflection",
    "table1", "ablation",
)  # fmt: skip
