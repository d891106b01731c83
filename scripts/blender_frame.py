"""Renders one frame of a VDB file made by `vdbgeo convert --for blender`, or all frames of a series:

    blender --background --factory-startup --python scripts/blender_frame.py -- in.vdb out.png [options]

  --surface        the grid `surface` as a mesh (volume-to-mesh modifier); else the grid `density` as fog
  --grid NAME      another grid than these two
  --opacity X      how thick the fog is: optical depth along the longest side of the box, where it is 1 [25]
  --turn DEGREES   the camera's place around the z axis [-60]
  --zoom X         how close the camera is [1]
  --width W --height H --samples N    [480 400 48], Cycles on the processor
  --save FILE      keep the scene as a .blend file, to go on with

An input such as frame_0001.vdb is the first of a series if --series is given; out.png becomes out_0001.png and so on.
"""
import argparse
import glob
import math
import pathlib
import re
import sys

import bpy
from mathutils import Vector


def arguments():
    parser = argparse.ArgumentParser(prog="blender_frame.py")
    parser.add_argument("vdb")
    parser.add_argument("picture")
    parser.add_argument("--surface", action="store_true")
    parser.add_argument("--grid")
    parser.add_argument("--opacity", type=float, default=25)
    parser.add_argument("--turn", type=float, default=-60)
    parser.add_argument("--zoom", type=float, default=1)
    parser.add_argument("--width", type=int, default=480)
    parser.add_argument("--height", type=int, default=400)
    parser.add_argument("--samples", type=int, default=48)
    parser.add_argument("--series", action="store_true")
    parser.add_argument("--save")
    return parser.parse_args(sys.argv[sys.argv.index("--") + 1:] if "--" in sys.argv else [])


def import_volume(path):
    bpy.ops.object.volume_import(filepath=str(pathlib.Path(path).resolve()))
    volume = bpy.context.object
    if not volume.data.grids.load():
        sys.exit(f"{path}: {volume.data.grids.error_message}")
    return volume


def box_of(thing):
    """Middle and longest side of what is shown, in scene units."""
    evaluated = thing.evaluated_get(bpy.context.evaluated_depsgraph_get())
    corners = [thing.matrix_world @ Vector(c) for c in evaluated.bound_box]
    low = Vector([min(c[a] for c in corners) for a in range(3)])
    high = Vector([max(c[a] for c in corners) for a in range(3)])
    return (low + high) / 2, max(high - low)


def new_material(name):
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    material.node_tree.nodes.clear()
    return material, material.node_tree.nodes, material.node_tree.links


def fog_material(grid, density):
    material, nodes, links = new_material("fog")
    shader = nodes.new("ShaderNodeVolumePrincipled")
    shader.inputs["Color"].default_value = (0.55, 0.75, 0.95, 1)
    shader.inputs["Density"].default_value = density
    shader.inputs["Density Attribute"].default_value = grid
    shader.inputs["Anisotropy"].default_value = 0.2
    links.new(shader.outputs["Volume"], nodes.new("ShaderNodeOutputMaterial").inputs["Volume"])
    return material


def surface_material():
    material, nodes, links = new_material("surface")
    shader = nodes.new("ShaderNodeBsdfPrincipled")
    shader.inputs["Base Color"].default_value = (0.35, 0.55, 0.8, 1)
    shader.inputs["Roughness"].default_value = 0.5
    links.new(shader.outputs["BSDF"], nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def as_mesh(volume, grid):
    """The level set's surface: where the distance is 0."""
    mesh = bpy.data.objects.new("surface", bpy.data.meshes.new("surface"))
    bpy.context.collection.objects.link(mesh)
    modifier = mesh.modifiers.new("volume to mesh", "VOLUME_TO_MESH")
    modifier.object = volume
    modifier.grid_name = grid
    modifier.threshold = 0
    modifier.use_smooth_shade = True
    mesh.data.materials.append(surface_material())
    volume.hide_render = True
    return mesh


def add_light(kind, energy, place, target, size=1):
    light = bpy.data.objects.new(kind, bpy.data.lights.new(kind, "AREA"))
    light.data.energy, light.data.size = energy, size
    light.location = place
    light.rotation_euler = (target - place).to_track_quat("-Z", "Y").to_euler()
    bpy.context.collection.objects.link(light)


def set_stage(middle, side, args):
    """Camera and three lights around a thing of this size."""
    turn = math.radians(args.turn)
    out = Vector((math.cos(turn), math.sin(turn), 0.35)).normalized()
    camera = bpy.data.objects.new("camera", bpy.data.cameras.new("camera"))
    camera.location = middle + out * side * 1.75 / args.zoom
    camera.rotation_euler = (middle - camera.location).to_track_quat("-Z", "Y").to_euler()
    camera.data.clip_end = 100 * side
    bpy.context.collection.objects.link(camera)
    bpy.context.scene.camera = camera
    across = out.cross(Vector((0, 0, 1))).normalized()
    power = side * side  # the same picture at any scale
    add_light("key", 90 * power, middle + (out + 1.2 * Vector((0, 0, 1)) - across) * 1.6 * side, middle, side)
    add_light("fill", 30 * power, middle + (out + 1.2 * across) * 1.8 * side, middle, 2 * side)
    add_light("rim", 80 * power, middle + (0.8 * Vector((0, 0, 1)) - out) * 1.8 * side, middle, side)
    world = bpy.data.worlds.new("world")
    world.use_nodes = True
    world.node_tree.nodes["Background"].inputs["Color"].default_value = (0.02, 0.02, 0.025, 1)
    bpy.context.scene.world = world


def set_render(args):
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = args.samples
    scene.cycles.volume_bounces = 2
    scene.render.resolution_x, scene.render.resolution_y = args.width, args.height
    scene.render.resolution_percentage = 100
    scene.view_settings.view_transform = "Standard"
    scene.render.image_settings.file_format = "PNG"
    try:
        scene.cycles.use_denoising = True
        scene.cycles.denoiser = "OPENIMAGEDENOISE"
    except TypeError:  # a Blender that was built without it
        scene.cycles.use_denoising = False


def render(path):
    bpy.context.scene.render.filepath = str(pathlib.Path(path).resolve())
    bpy.ops.render.render(write_still=True)


def main():
    args = arguments()
    bpy.ops.object.select_all(action="SELECT")
    bpy.ops.object.delete()
    grid = args.grid or ("surface" if args.surface else "density")
    volume = import_volume(args.vdb)
    if grid not in [g.name for g in volume.data.grids]:
        sys.exit(f"{args.vdb}: no grid '{grid}' among {[g.name for g in volume.data.grids]}")
    shown = as_mesh(volume, grid) if args.surface else volume
    bpy.context.view_layer.update()
    middle, side = box_of(shown)
    if not args.surface:
        volume.data.materials.clear()
        volume.data.materials.append(fog_material(grid, args.opacity / side))
    set_stage(middle, side, args)
    set_render(args)
    if args.save:
        bpy.ops.wm.save_as_mainfile(filepath=str(pathlib.Path(args.save).resolve()))
    if not args.series:
        return render(args.picture)
    picture = pathlib.Path(args.picture)
    for frame in sorted(glob.glob(re.sub(r"_\d+\.vdb$", "_*.vdb", args.vdb))):
        volume.data.filepath = str(pathlib.Path(frame).resolve())
        volume.data.grids.load()
        render(picture.with_name(picture.stem + re.search(r"_\d+", frame[frame.rfind("_"):]).group() + ".png"))


main()
