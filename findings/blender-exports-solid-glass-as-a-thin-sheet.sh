#!/bin/sh
# Blender 5.0.1: a ball of glass (Principled, transmission 1), which Cycles refracts as a solid, is solid in
# none of the default exports. The glTF has KHR_materials_transmission without KHR_materials_volume, which is by
# definition a thin wall that does not refract: the ball becomes a soap bubble. The OBJ has `d 1` and
# `illum 2`, opaque grey; only with `export_pbr_extensions` is there a `Tf`, which holds the weight.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3.11 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q bpy==5.0.1  # needs Debian's libxrender1 libxi6 libxkbcommon0 libsm6 libgl1 libegl1 libxfixes3
cat > "$dir/try.py" <<'EOF'

import json
import os
import sys

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.mesh.primitive_uv_sphere_add()
material = bpy.data.materials.new("glass")
material.use_nodes = True
inputs = material.node_tree.nodes["Principled BSDF"].inputs
inputs["Transmission Weight"].default_value = 1.0
inputs["Roughness"].default_value = 0.0
bpy.context.object.data.materials.append(material)
path = os.path.join(sys.argv[1], "ball")
bpy.ops.export_scene.gltf(filepath=path + ".gltf", export_format="GLTF_SEPARATE")
extensions = json.load(open(path + ".gltf"))["materials"][0]["extensions"]
mtl = []
for extended in (False, True):
    bpy.ops.wm.obj_export(filepath=path + ".obj", export_pbr_extensions=extended)
    lines = [line.split() for line in open(path + ".mtl") if line.strip()]
    mtl.append({line[0]: line[1:] for line in lines if line[0] in ("d", "illum", "Tf")})
print("seen: bpy", bpy.app.version_string, "glTF:", extensions, "MTL, plain and extended:", mtl)
assert extensions == {"KHR_materials_transmission": {"transmissionFactor": 1}}
assert mtl[0] == {"d": ["1.000000"], "illum": ["2"]}
assert mtl[1] == {"d": ["1.000000"], "illum": ["2"], "Tf": ["1.000000"] * 3}
EOF
"$dir/venv/bin/python" "$dir/try.py" "$dir" > "$dir/log" 2>&1 || { cat "$dir/log"; echo "behaviour changed"; exit 1; }
grep "^seen:" "$dir/log"
