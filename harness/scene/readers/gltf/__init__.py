"""glTF 2.0, text and binary.

A file is opened and its entries read (:mod:`.container`), then arrays (:mod:`.accessors`). Nodes (:mod:`.nodes`) place
meshes (:mod:`.primitives`): what is drawn (:mod:`.model`). An animation (:mod:`.animation`), morph targets and skins move
it in frames; :mod:`.read` has them, finds cameras and lights, and puts all together.
"""
