#!/bin/sh
# Blender 5.0.1: a sun of UsdLux, a DistantLight with normalize = 1, whose intensity is then the irradiance of a
# surface that faces it, comes in with four times its strength and twice its angle: intensity 2 and angle 10 degrees
# become strength 8 and 20 degrees, where Blender's strength is that irradiance too. It writes the inverse, so that
# files of its own come back as they were, and only other programs' files show it. Without normalize, where the
# intensity is a radiance and the irradiance depends on the angle, the same factor of four is taken.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3.11 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q bpy==5.0.1  # needs Debian's libxrender1 libxi6 libxkbcommon0 libsm6 libgl1 libegl1 libxfixes3
cat > "$dir/suns.usda" <<'END'
#usda 1.0
(
    metersPerUnit = 1
    upAxis = "Z"
)
def DistantLight "normal"
{
    float inputs:angle = 10
    float inputs:intensity = 2
    bool inputs:normalize = 1
}
def DistantLight "plain"
{
    float inputs:angle = 10
    float inputs:intensity = 2
    bool inputs:normalize = 0
}
END
cat > "$dir/try.py" <<'END'
import math
import os
import sys

import bpy

bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.wm.usd_import(filepath=os.path.join(sys.argv[1], "suns.usda"))
suns = {s.name: (round(s.energy, 4), round(math.degrees(s.angle), 3)) for s in bpy.data.lights}
print("seen: bpy", bpy.app.version_string, "strength and angle in degrees:", suns)

bpy.ops.wm.read_factory_settings(use_empty=True)
sun = bpy.data.lights.new("sun", "SUN")
sun.energy, sun.angle = 2.0, math.radians(10)
bpy.context.scene.collection.objects.link(bpy.data.objects.new("sun", sun))
path = os.path.join(sys.argv[1], "out.usda")
bpy.ops.wm.usd_export(filepath=path)
with open(path) as file:
    lines = [line.split("inputs:")[1].strip() for line in file if "inputs:angle" in line or "inputs:intensity" in line]
print("seen: strength 2 and 10 degrees are written as", lines)
assert suns["normal"] == (8.0, 20.0) and suns["plain"] == (8.0, 20.0)
assert lines == ["angle = 5", "intensity = 0.5"]
END
"$dir/venv/bin/python" "$dir/try.py" "$dir" > "$dir/log" 2>&1 || { cat "$dir/log"; echo "behaviour changed"; exit 1; }
grep "^seen:" "$dir/log"
