"""glTF 2.0, text and binary.

A file is opened (:mod:`.container`); its entries (:mod:`.entries`) and arrays (:mod:`.accessors`, :mod:`.compressed`) are
read. Nodes (:mod:`.nodes`) place meshes (:mod:`.primitives`): what is drawn (:mod:`.model`). An animation
(:mod:`.animation`) moves the nodes, and morph targets and skins (:mod:`.deformation`) the vertices, in frames
(:mod:`.frames`). :mod:`.viewpoints` finds cameras and lights; :mod:`.read` puts it together.
"""
