"""Hashes of trees, one for each builder and size: the same on a CPU and on the emulated GPU."""

import hashlib
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from helpers.small_scenes import make_scene, soup
from helpers.tuned_trees import built
from shadowbench.methods.trees.constants import BLOCK

SETTINGS = ({"builder": "lbvh"}, {"builder": "hploc"}, {"update": "refit"})

if __name__ == "__main__":
    for count in (1, 2, 3, BLOCK - 1, BLOCK, BLOCK + 1, 5 * BLOCK):
        prepared = make_scene(*soup(count, count), [(5.0, 4.0, 3.0)])
        for settings in SETTINGS:
            tree = built(prepared, settings).method._rays.tree
            found = hashlib.sha256(tree.nodes.numpy().tobytes() + tree.root.numpy().tobytes())
            print(count, settings, found.hexdigest())
