#!/bin/sh
# Cycles of Blender 5.0.1: with "Normalize" off a point lamp of radius r gives intensity proportional to
# r squared, as it should, but at r = 0 exactly it does not go dark: it shines as a sphere whose
# cross-section is 1 m2, 3183 times as bright as the same lamp of radius 1 cm.
# One would expect the limit, nothing, or the lamp as with "Normalize" on (4 times less).
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



values = {}
for radius in (0.0, 0.01, 0.1):
    scene = room()
    lamp(scene, "POINT", energy=100, shadow_soft_size=radius, normalize=False)
    values[radius] = floor_rgb(scene)[1]
scene = room()
lamp(scene, "POINT", energy=100, shadow_soft_size=0)
normalized = floor_rgb(scene)[1]
print("seen: bpy", bpy.app.version_string, "radiance of the floor by radius", values, "normalized", normalized)
assert abs(values[0.1] / values[0.01] - 100) < 1
assert abs(values[0.0] / values[0.01] - 3183) < 30
assert abs(values[0.0] / normalized - 4) < 0.01
EOF
"$dir/venv/bin/python" "$dir/try.py" "$dir" > "$dir/log" 2>&1 || { cat "$dir/log"; echo "behaviour changed"; exit 1; }
grep "^seen:" "$dir/log"
