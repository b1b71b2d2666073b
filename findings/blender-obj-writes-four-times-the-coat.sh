#!/bin/sh
# Blender 5.0.1 with `export_pbr_extensions` writes `Pc`, in the PBR extension of MTL the thickness of the clear coat, as
# four times the weight of the coat (and divides again when it reads). A coat of weight .25 is `Pc 1`, a full
# coat `Pc 4`, beyond the range of 0 to 1 that the other numbers have; whoever takes Pc for a weight and
# clamps it makes every coat of .25 and more a full one.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3.11 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q bpy==5.0.1  # needs Debian's libxrender1 libxi6 libxkbcommon0 libsm6 libgl1 libegl1 libxfixes3
cat > "$dir/try.py" <<'EOF'

import os
import sys

import bpy

seen = {}
for weight in (0.0, 0.25, 0.5, 1.0):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.mesh.primitive_cube_add()
    material = bpy.data.materials.new("paint")
    material.use_nodes = True
    material.node_tree.nodes["Principled BSDF"].inputs["Coat Weight"].default_value = weight
    bpy.context.object.data.materials.append(material)
    bpy.ops.wm.obj_export(filepath=os.path.join(sys.argv[1], "cube.obj"), export_pbr_extensions=True)
    lines = open(os.path.join(sys.argv[1], "cube.mtl")).read().split("\n")
    seen[weight] = next(float(line.split()[1]) for line in lines if line.startswith("Pc "))
print("seen: bpy", bpy.app.version_string, "coat weight -> Pc:", seen)
assert seen == {0.0: 0.0, 0.25: 1.0, 0.5: 2.0, 1.0: 4.0}
EOF
"$dir/venv/bin/python" "$dir/try.py" "$dir" > "$dir/log" 2>&1 || { cat "$dir/log"; echo "behaviour changed"; exit 1; }
grep "^seen:" "$dir/log"
