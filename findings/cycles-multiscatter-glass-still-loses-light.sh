#!/bin/sh
# Cycles of Blender 5.0.1: the Glass BSDF with "Multiscatter GGX" does not keep all light, though its name and purpose
# say so. A clear ball in a white world of brightness 1 should vanish at any roughness. It does when smooth; at
# roughness 0.6 it shows .98, at enough bounces for the difference not to be theirs (64 and 128 agree). A white
# Glossy BSDF of the same roughness and distribution does vanish.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3.11 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q bpy==5.0.1  # needs Debian's libxrender1 libxi6 libxkbcommon0 libsm6 libgl1 libegl1 libxfixes3
cat > "$dir/try.py" <<'EOF'
import os
import sys

import bpy
import numpy as np


def ball(kind, roughness, bounces):
    """Mean of a ball in a white world, but for its rim."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    cycles = scene.cycles
    cycles.samples = 1024
    cycles.use_adaptive_sampling = cycles.use_denoising = False
    cycles.max_bounces = cycles.glossy_bounces = cycles.transmission_bounces = bounces
    cycles.blur_glossy = cycles.sample_clamp_indirect = cycles.sample_clamp_direct = 0
    scene.render.resolution_x = scene.render.resolution_y = 32
    scene.world = bpy.data.worlds.new("white")
    scene.world.use_nodes = True
    scene.world.node_tree.nodes["Background"].inputs[0].default_value = (1, 1, 1, 1)
    material = bpy.data.materials.new("ball")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new(kind)
    shader.distribution = "MULTI_GGX"
    shader.inputs["Color"].default_value = (1, 1, 1, 1)
    shader.inputs["Roughness"].default_value = roughness
    tree.links.new(shader.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    bpy.ops.mesh.primitive_uv_sphere_add(radius=1, segments=64, ring_count=32)
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(material)
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.ortho_scale = "ORTHO", 2
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.camera.location = (0, 0, 3)
    scene.collection.objects.link(scene.camera)
    path = os.path.join(sys.argv[1], "picture.exr")
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(path, check_existing=False)
    y, x = (np.mgrid[:32, :32] + 0.5) / 16 - 1
    return np.array(picture.pixels[:]).reshape(32, 32, 4)[..., 1][x * x + y * y < 0.9].mean()


glass = "ShaderNodeBsdfGlass"
smooth, rough, longer = ball(glass, 0.0, 64), ball(glass, 0.6, 64), ball(glass, 0.6, 128)
glossy = ball("ShaderNodeBsdfAnisotropic", 0.6, 64)
print("seen: bpy", bpy.app.version_string, "smooth %.4f rough %.4f with 128 bounces %.4f glossy %.4f" % (smooth, rough, longer, glossy))
assert abs(smooth - 1) < 0.002 and abs(glossy - 1) < 0.004
assert 0.965 < rough < 0.99 and abs(rough - longer) < 0.004
EOF
"$dir/venv/bin/python" "$dir/try.py" "$dir" > "$dir/log" 2>&1 || { cat "$dir/log"; echo "behaviour changed"; exit 1; }
grep "^seen:" "$dir/log"
