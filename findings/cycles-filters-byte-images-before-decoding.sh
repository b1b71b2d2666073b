#!/bin/sh
# Cycles of Blender 5.0.1 interpolates a texture of 8 bits in sRGB as it is encoded, and decodes what comes out: half-way
# between a black and a white texel it shows .21. The same image with floating-point numbers shows .50 there, as
# glTF 2.0 asks of every sRGB texture (decode, then filter) and as other renderers do with both.
# So the same texture is darker at every edge in Cycles than elsewhere: these two texels by 19 % in the mean.
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


def across(is_float):
    """Linear values along a plane that shines with an image of a black and a white texel, left to right."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.samples = 64
    scene.cycles.use_denoising = False
    scene.render.resolution_x, scene.render.resolution_y = 64, 8
    image = bpy.data.images.new("texels", width=2, height=1, float_buffer=is_float)
    image.colorspace_settings.name = "Linear Rec.709" if is_float else "sRGB"
    image.pixels = [0, 0, 0, 1, 1, 1, 1, 1]
    image.pack()
    material = bpy.data.materials.new("shining")
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    texture = tree.nodes.new("ShaderNodeTexImage")
    texture.image, texture.extension, texture.interpolation = image, "EXTEND", "Linear"
    shine = tree.nodes.new("ShaderNodeEmission")
    tree.links.new(texture.outputs["Color"], shine.inputs["Color"])
    tree.links.new(shine.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    bpy.ops.mesh.primitive_plane_add(size=2)
    bpy.context.object.data.materials.append(material)
    camera = bpy.data.cameras.new("camera")
    camera.type, camera.ortho_scale = "ORTHO", 2
    scene.camera = bpy.data.objects.new("camera", camera)
    scene.camera.location = (0, 0, 1)
    scene.collection.objects.link(scene.camera)
    path = os.path.join(sys.argv[1], "picture.exr")
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.filepath = path
    bpy.ops.render.render(write_still=True)
    picture = bpy.data.images.load(path, check_existing=False)
    return np.array(picture.pixels[:]).reshape(8, 64, 4)[4, :, 1]


of_bytes, of_floats = across(False), across(True)
middle = [values[31:33].mean() for values in (of_bytes, of_floats)]
mean = [values.mean() for values in (of_bytes, of_floats)]
print("seen: bpy", bpy.app.version_string, "middle of 8 bits and of floats %.3f %.3f," % tuple(middle), "mean %.3f %.3f" % tuple(mean))
assert abs(middle[0] - 0.214) < 0.01 and abs(middle[1] - 0.5) < 0.01
assert abs(mean[1] - 0.5) < 0.01 and mean[0] < 0.45
EOF
"$dir/venv/bin/python" "$dir/try.py" "$dir" > "$dir/log" 2>&1 || { cat "$dir/log"; echo "behaviour changed"; exit 1; }
grep "^seen:" "$dir/log"
