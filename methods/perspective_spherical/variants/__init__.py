"""What the ablation compares with the defaults: maps and bounds of the light's grid, balancing, split lists."""
