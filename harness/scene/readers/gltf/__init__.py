"""glTF 2.0, text and binary.

A file is opened (:mod:`.container`); its entries (:mod:`.entries`) and arrays (:mod:`.accessors`) are read. Nodes
(:mod:`.nodes`) place meshes (:mod:`.primitives`): what is drawn (:mod:`.model`). An animation (:mod:`.animation`), morph
targets and skins move it in frames (:mod:`.frames`). :mod:`.viewpoints` finds cameras and lights; :mod:`.read` puts it
together.
"""
