#!/bin/sh
# Blender 5.0.1, glTF exporter: the scale of an orthographic camera is written as if the sensor fit were
# "Auto", while that of a perspective camera follows the fit. With fit "Vertical" and a wide picture the
# scale 3 is the height that Blender shows (width 5.33); the file says width 3 and height 1.69, so
# other programs see the scene 1.78 times as large.
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
scene = bpy.context.scene
scene.render.resolution_x, scene.render.resolution_y = 1920, 1080
camera = bpy.data.cameras.new("camera")
camera.type, camera.sensor_fit, camera.ortho_scale = "ORTHO", "VERTICAL", 3.0
scene.camera = bpy.data.objects.new("camera", camera)
scene.collection.objects.link(scene.camera)
corners = camera.view_frame(scene=scene)
shown = [max(c[axis] for c in corners) for axis in (0, 1)]
path = os.path.join(sys.argv[1], "camera.gltf")
bpy.ops.export_scene.gltf(filepath=path, export_format="GLTF_SEPARATE", export_cameras=True)
written = json.load(open(path))["cameras"][0]["orthographic"]
print("seen: bpy", bpy.app.version_string, "half width and height shown:", shown, "written:", written)
assert abs(shown[1] - 1.5) < 1e-5 and abs(shown[0] - 1.5 * 16 / 9) < 1e-4
assert abs(written["xmag"] - 1.5) < 1e-5 and abs(written["ymag"] - 0.84375) < 1e-5
EOF
"$dir/venv/bin/python" "$dir/try.py" "$dir" > "$dir/log" 2>&1 || { cat "$dir/log"; echo "behaviour changed"; exit 1; }
grep "^seen:" "$dir/log"
