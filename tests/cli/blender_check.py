"""What Blender makes of a VDB file, as one line of JSON: its grids, where they lie, and the meshes at given levels.

blender --background --factory-startup --python blender_check.py -- FILE.vdb [GRID=LEVEL ...]
"""
import json
import sys

import bmesh
import bpy

arguments = sys.argv[sys.argv.index("--") + 1:]
bpy.ops.object.volume_import(filepath=arguments[0])
volume = bpy.context.object
grids = volume.data.grids
result = {"loaded": grids.load(), "grids": {}, "meshes": {}}
corners = [tuple(c) for c in volume.bound_box]
result["low"] = [min(c[a] for c in corners) for a in range(3)]
result["high"] = [max(c[a] for c in corners) for a in range(3)]
for grid in grids:
    result["grids"][grid.name] = {"type": grid.data_type, "matrix": [list(row) for row in grid.matrix_object]}
for text in arguments[1:]:
    name, level = text.split("=")
    thing = bpy.data.objects.new(name, bpy.data.meshes.new(name))
    bpy.context.collection.objects.link(thing)
    modifier = thing.modifiers.new("mesh", "VOLUME_TO_MESH")
    modifier.object, modifier.grid_name, modifier.threshold = volume, name, float(level)
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    mesh = bmesh.new()
    mesh.from_mesh(evaluated.to_mesh())
    result["meshes"][name] = {"faces": len(mesh.faces), "volume": abs(mesh.calc_volume())}
print("RESULT " + json.dumps(result))
