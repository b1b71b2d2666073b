#!/bin/sh
# Cycles of Blender 5.0.1: the spread of an area lamp is no grid in front of a softbox. A grid takes light
# away and leaves the axis as bright as it was; narrowing the spread of a lamp of 100 W from 180 to 90
# degrees makes the axis 4.65 times as bright, to 30 degrees 43 times, so a lamp read without its spread
# (or a spread added to a found lamp) is wrong by that factor on the axis.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3.11 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q bpy==5.0.1  # needs Debian's libxrender1 libxi6 libxkbcommon0 libsm6 libgl1 libegl1 libxfixes3
cat > "$dir/try.py" <<'EOF'
import math
import os
import sys

import bpy
import numpy as np


def room():
    """A white diffuse floor 5 m below where the lamp goes, seen from above by a tiny camera."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 64
    scene.cycles.max_bounces = 0
    scene.cycles.use_denoising = False
    scene.render.resolution_x = scene.render.resolution_y = 8
    material = bpy.data.materials.new("white")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    diffuse = tree.nodes.new("ShaderNodeBsdfDiffuse")
    diffuse.inputs[0].default_value = (1, 1, 1, 1)
    tree.links.new(diffuse.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs[0])
    bpy.ops.mesh.primitive_plane_add(size=2)
    bpy.context.object.data.materials.append(material)
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.ortho_scale = "ORTHO", 0.05
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.camera.location = (0, 0, 1)
    scene.collection.objects.link(scene.camera)
    return scene


def lamp(scene, kind, **properties):
    data = bpy.data.lights.new("lamp", kind)
    for name, value in properties.items():
        setattr(data, name, value)
    thing = bpy.data.objects.new("lamp", data)
    thing.location = (0, 0, 5)
    scene.collection.objects.link(thing)
    return data


def floor_rgb(scene):
    """Linear radiance of the floor under the lamp."""
    path = os.path.join(sys.argv[1], "picture.exr")
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    image = bpy.data.images.load(path, check_existing=False)
    return np.array(image.pixels[:]).reshape(-1, 4)[:, :3].mean(axis=0)



axis = []
for degrees in (180, 90, 30):
    scene = room()
    lamp(scene, "AREA", energy=100, size=0.02, spread=math.radians(degrees))
    axis.append(floor_rgb(scene)[1])
ratios = [a / axis[0] for a in axis]
print("seen: bpy", bpy.app.version_string, "on the axis, beside 180 degrees:", ratios)
assert abs(ratios[1] - 4.65) < 0.05 and abs(ratios[2] - 43.3) < 0.5
EOF
"$dir/venv/bin/python" "$dir/try.py" "$dir" > "$dir/log" 2>&1 || { cat "$dir/log"; echo "behaviour changed"; exit 1; }
grep "^seen:" "$dir/log"
