#!/bin/sh
# Blender 5.0.1 writes `inputs:enableColorTemperature = 1` (and no temperature) for every lamp of a USD file,
# also for those that have no colour temperature. Read back by the same Blender the lamp is switched to
# 6500 K, whose blackbody is no neutral white in Cycles: red and green move apart by 5 percent. A white lamp
# is expected to come back white.
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



scene = room()
lamp(scene, "POINT", energy=100, shadow_soft_size=0)
before = floor_rgb(scene)
path = os.path.join(sys.argv[1], "lamp.usda")
bpy.ops.wm.usd_export(filepath=path)
written = "inputs:enableColorTemperature = 1" in open(path).read()
scene = room()
bpy.ops.wm.usd_import(filepath=path, import_meshes=False, import_cameras=False, import_materials=False)
found = next(thing.data for thing in bpy.data.objects if thing.type == "LIGHT")
after = floor_rgb(scene)
print("seen: bpy", bpy.app.version_string, "enabled in the file:", written, "use_temperature:", found.use_temperature,
      "rgb before", before, "after", after)
assert written and found.use_temperature
assert np.ptp(before) < 1e-6
assert abs(after[0] / after[1] - 1.05) < 0.02
EOF
"$dir/venv/bin/python" "$dir/try.py" "$dir" > "$dir/log" 2>&1 || { cat "$dir/log"; echo "behaviour changed"; exit 1; }
grep "^seen:" "$dir/log"
