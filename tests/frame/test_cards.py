"""Which cards have ray tracing units: each kind of chip, by its compute capability and its name."""

import pytest
from shadowbench.harness.frame.cards import has_ray_tracing_units


@pytest.mark.parametrize(
    ("capability", "name", "has"),
    [
        (61, "NVIDIA GeForce GTX 1080", False), (70, "Tesla V100-SXM2-16GB", False),
        (75, "NVIDIA GeForce RTX 2080 Ti", True), (75, "Quadro RTX 6000", True), (75, "TITAN RTX", True),
        (75, "Tesla T4", True), (75, "NVIDIA GeForce GTX 1660 Ti", False), (75, "NVIDIA T1000", False),
        (80, "NVIDIA A100-SXM4-80GB", False), (86, "NVIDIA A10", True), (86, "NVIDIA GeForce RTX 3090", True),
        (89, "NVIDIA L40S", True), (90, "NVIDIA H100 80GB HBM3", False), (90, "NVIDIA H200", False),
        (100, "NVIDIA B200", False), (120, "NVIDIA GeForce RTX 5090", True), (87, "Orin", None),
    ],
)  # fmt: skip
def test_ray_tracing_units(capability, name, has):
    assert has_ray_tracing_units(capability, name) is has
