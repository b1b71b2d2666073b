#!/bin/sh
# Blender 5.0.1: the view transform "Khronos PBR Neutral" is not Khronos' published tone mapper. Greys agree, and
# most colours within a code value of 255, but where one channel of a saturated colour is nearly dark Blender
# lifts it: (.0025, .8, .25) has 9.7 in red where the formula gives 2.0. Whoever compares with glTF viewers, or
# inverts the view by the formula, is off by up to 8/255 there.
set -eu
dir=$(mktemp -d)
trap 'rm -rf "$dir"' EXIT
python3.11 -m venv "$dir/venv"
"$dir/venv/bin/pip" install -q bpy==5.0.1  # needs Debian's libxrender1 libxi6 libxkbcommon0 libsm6 libgl1 libegl1 libxfixes3
cat > "$dir/try.py" <<'END'
import os
import sys

import bpy
import numpy as np


def neutral(c):
    """The tone mapper that Khronos published, display-linear."""
    low = c.min()
    c = c - (low - 6.25 * low * low if low < 0.08 else 0.04)
    peak = c.max()
    if peak < 0.76:
        return c
    new = 1 - 0.24**2 / (peak + 0.24 - 0.76)
    share = 1 - 1 / (0.15 * (peak - new) + 1)
    return c * new / peak * (1 - share) + share * new


def encoded(c):
    return np.where(c <= 0.0031308, 12.92 * c, 1.055 * c ** (1 / 2.4) - 0.055)


colours = np.array([[0.18] * 3, [1.0] * 3, [4.0] * 3, [0.0025, 0.8, 0.25], [0.0038, 0.0127, 0.79]])
scene = bpy.context.scene
scene.view_settings.view_transform = "Khronos PBR Neutral"
scene.view_settings.look = "None"
scene.render.image_settings.file_format = "PNG"
scene.render.image_settings.color_depth = "16"
chart = bpy.data.images.new("chart", len(colours), 1, float_buffer=True)
chart.colorspace_settings.name = "Linear Rec.709"
chart.pixels = np.concatenate([colours, np.ones((len(colours), 1))], axis=1).ravel().tolist()
path = os.path.join(sys.argv[1], "chart.png")
chart.save_render(path, scene=scene)
shown = bpy.data.images.load(path)
shown.colorspace_settings.name = "Non-Color"
shown = 255 * np.array(shown.pixels[:]).reshape(-1, 4)[:, :3]
wanted = 255 * np.array([encoded(neutral(c)) for c in colours])
off = np.abs(shown - wanted).max(axis=1)
print("seen: bpy", bpy.app.version_string, "codes of 255 off:", off.round(2), "shown", shown[3:].round(1).tolist())
assert off[:3].max() < 1.0 and (off[3:] > 7.0).all() and (off[3:] < 8.5).all()
END
"$dir/venv/bin/python" "$dir/try.py" "$dir" > "$dir/log" 2>&1 || { cat "$dir/log"; echo "behaviour changed"; exit 1; }
grep "^seen:" "$dir/log"
