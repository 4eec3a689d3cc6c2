"""Which GPUs have units that trace rays. No call of CUDA says so: it follows from the kind of chip and the card's name."""

UNITS = "ray tracing units"  # the fact in the `built` of a method that may use them: yes, none or unknown
TURING = 75  # the first chips with such units, as compute capabilities are written here: 75 for 7.5

WITH, WITHOUT = {86, 89, 120}, {80, 90, 100, 103}
"""Later chips with units, and those of data centres without them (A100, H100, H200, B200, B300)."""

TURING_WITH = ("RTX", "T4", "T4G")  # in the names of Turing's cards with units; GTX 16, MX 450, T400 to T1200 have none


def has_ray_tracing_units(capability: int, name: str) -> bool | None:
    """Whether a card has units that trace rays; None for chips that are not listed, such as those of embedded modules."""
    if capability < TURING or capability in WITHOUT:
        return False
    if capability == TURING:
        return any(word in name.split() for word in TURING_WITH)
    return True if capability in WITH else None
