#!/usr/bin/env python3
"""Compares our pictures with Cycles', lamp by lamp, through the exports to Blender, USD and glTF.

    python3.11 -m venv target/blender && target/blender/bin/pip install -r tests/blender/requirements.txt
    cargo build --release && target/blender/bin/python tests/blender/compare.py

`bpy` is the whole of Blender without a window; it needs Debian's libxrender1, libxi6, libxkbcommon0,
libsm6, libgl1, libegl1 and libxfixes3. Each kind of light is put into a room of diffuse materials, the room
is exported, and rendered by both programs. The ratio of the means (ours over Cycles') must be 1 within the
tolerance of its line, which is that of noise where the export is exact; one line each; exit status 1 when
one is not.
"""

import argparse
import json
import subprocess
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
import OpenEXR

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
SIZE = (64, 48)
MAX_DEPTH = 5

ROOM = """mtllib room.mtl
o floor
usemtl grey
v -2 0 2
v 2 0 2
v 2 0 -2
v -2 0 -2
f 1 2 3 4
o wall
usemtl red
v -2 0 -2
v 2 0 -2
v 2 2.5 -2
v -2 2.5 -2
f 5 6 7 8
o block
usemtl blue
v -0.7 0 0.3
v 0.1 0 0.3
v 0.1 0 -0.5
v -0.7 0 -0.5
v -0.7 0.8 0.3
v 0.1 0.8 0.3
v 0.1 0.8 -0.5
v -0.7 0.8 -0.5
f 9 10 14 13
f 10 11 15 14
f 11 12 16 15
f 12 9 13 16
f 13 14 15 16
"""
MATERIALS = "".join(f"newmtl {name}\nKd {kd}\nillum 1\n" for name, kd in
                    [("grey", "0.6 0.6 0.6"), ("red", "0.7 0.3 0.2"), ("blue", "0.2 0.3 0.7")])
SIDECAR = """schema = 1
exposure = 2.0
[camera]
position = [0.4, 1.6, 4.2]
look_at = [0.0, 0.6, 0.0]
vfov = 38.0
size = [64, 48]
shift = [0.05, -0.08]
[main_object]
objects = ["block"]
[background]
materials = ["grey"]
"""
AIM = "position = [1.1, 2.2, 0.9]\nlook_at = [0.0, 0.3, 0.0]\ncamera_visible = false\n"
COLOR = "color = [1.0, 0.6, 0.3]\n"

# Name: the light, and what the ratio may differ from 1 by; 0.5 % is what is asked of all that is exact.
LIGHTS = {
    "rectangle": ('type = "rectangle"\nhalf_extents = [0.5, 0.2]\nsize = 1.5\nradiance = 3.0\n' + AIM, 0.005),
    "disk": ('type = "disk"\nradius = 0.3\nsize = 1.4\nradiance = 4.0\n' + AIM, 0.005),
    "sphere": ('type = "sphere"\nposition = [0.9, 1.6, 0.9]\nradius = 0.2\nsize = 0.8\nradiance = 9.0\n'
               "camera_visible = false\n", 0.005),
    "point": ('type = "point"\nposition = [0.9, 1.6, 0.9]\nradiance = 2.0\n', 0.005),
    "spot": ('type = "spot"\nradius = 0.0\nangle = 30.0\nsoftness = 0.6\nradiance = 8.0\n'
             + AIM.replace("camera_visible = false\n", ""), 0.005),
    # A disk here and a sphere of the same power there: less at the edge of the cone.
    "spot_disk": ('type = "spot"\nradius = 0.1\nangle = 30.0\nsoftness = 0.6\nradiance = 300.0\n' + AIM, 0.01),
    "distant": ('type = "distant"\nlook_at = [-0.6, -1.0, -0.5]\nradiance = 3.0\n', 0.005),
    "sky": ('type = "environment"\nradiance = 0.7\n', 0.005),
    "picture": ('type = "environment"\nradiance = 0.8\nimage = "sky.hdr"\nrotation = 40.0\n', 0.005),
    "colour": ('type = "rectangle"\nhalf_extents = [0.5, 0.2]\nradiance = 3.0\n' + COLOR + AIM, 0.005),
}
# What Blender shows otherwise of a format: the ratio that is expected and its tolerance, or None for no test.
OTHERWISE = {
    # The schema's irradiance with `normalize`; Blender reads four times as much, and writes a quarter itself.
    ("usd", "distant"): (0.25, 0.005),
    # Blender takes the softness of a cone, a share of its angle, for its own blend, a share of the cosine.
    ("usd", "spot"): (0.85, 0.01), ("usd", "spot_disk"): (0.85, 0.01),
    # Punctual lights: a panel's light falls off otherwise, and surroundings are not carried.
    **{("gltf", name): None for name in ["rectangle", "disk", "colour", "spot_disk", "spot", "sky", "picture"]},
}


def run(program, *args):
    done = subprocess.run([program, *map(str, args)], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{program} {' '.join(map(str, args))}: {done.stderr.strip()}")
    return done.stderr


def pixels(path):
    """The RGB of a picture, from the top."""
    channels = OpenEXR.File(str(path), separate_channels=True).parts[0].channels
    names = {name.split(".")[-1]: name for name in channels}
    return np.stack([channels[names[c]].pixels for c in "RGB"], axis=-1).astype(np.float64)


def diffuse():
    """Gives all materials a Diffuse BSDF of their base colour."""
    for material in bpy.data.materials:
        tree = material.node_tree
        principled = next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED")
        color = tuple(principled.inputs["Base Color"].default_value)
        tree.nodes.clear()
        shader = tree.nodes.new("ShaderNodeBsdfDiffuse")
        shader.inputs["Color"].default_value = color
        out = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(shader.outputs[0], out.inputs["Surface"])


def cycles(path, spp, seed):
    """Renders what is open, as our paths are."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    c = scene.cycles
    c.samples, c.seed, c.use_denoising, c.use_adaptive_sampling = spp, seed, False, False
    c.max_bounces = c.diffuse_bounces = c.glossy_bounces = c.transmission_bounces = MAX_DEPTH - 2
    c.sample_clamp_direct = c.sample_clamp_indirect = c.light_sampling_threshold = c.blur_glossy = 0
    scene.render.resolution_x, scene.render.resolution_y = SIZE
    scene.render.resolution_percentage = 100
    scene.render.filter_size = 0.01  # A pixel's own samples, as by our box filter.
    c.pixel_filter_type = "BOX"
    c.filter_width = 1.0
    scene.render.image_settings.file_format = "OPEN_EXR"
    scene.render.image_settings.color_depth = "32"
    scene.render.use_compositing = False
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)
    return pixels(path)


def camera_of(script):
    """Takes the camera of the script for Blender, for formats whose reader has none."""
    names = {"__file__": str(script), "__name__": "script"}
    exec(compile(script.read_text(), str(script), "exec"), names)
    names["set_camera"](json.loads(names["DATA"])["camera"])


def read_blender(out):
    exec(compile(out.read_text(), str(out), "exec"), {"__file__": str(out), "__name__": "__main__"})


def read_usd(out):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    # Only a world that is there is lit by a dome.
    world = bpy.context.scene.world = bpy.data.worlds.new("World")
    next(n for n in world.node_tree.nodes if n.type == "BACKGROUND").inputs["Strength"].default_value = 0.0
    bpy.ops.wm.usd_import(filepath=str(out), set_frame_range=False)


def read_gltf(out):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    bpy.ops.import_scene.gltf(filepath=str(out))


def usd_is_valid(path):
    """What usd-core, which is not Blender's own, says of the layer; in a process of its own."""
    code = ("import sys; from pxr import Usd, UsdLux, UsdGeom; s = Usd.Stage.Open(sys.argv[1]);"
            "assert UsdGeom.GetStageMetersPerUnit(s) == 1 and UsdGeom.GetStageUpAxis(s) == 'Y';"
            "n = [p for p in s.Traverse() if p.HasAPI(UsdLux.LightAPI)]; assert len(n) == 1, n;"
            "l = UsdLux.LightAPI(n[0]); print(n[0].GetTypeName(), l.GetIntensityAttr().Get(),"
            "l.GetNormalizeAttr().Get(), l.GetColorAttr().Get())")
    return subprocess.run([sys.executable, "-c", code, str(path)], capture_output=True, text=True)


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", default=str(ROOT / "target/release/lightopt-embree"))
    parser.add_argument("--spp", type=int, default=512)
    parser.add_argument("--keep", type=Path, help="directory for scenes, exports and pictures")
    parser.add_argument("names", nargs="*")
    args = parser.parse_args()
    directory = args.keep or Path(tempfile.mkdtemp())
    directory.mkdir(parents=True, exist_ok=True)
    (directory / "room.obj").write_text(ROOM)
    (directory / "room.mtl").write_text(MATERIALS)
    (directory / "sky.hdr").write_bytes((ROOT / "tests/mitsuba/scenes/sky.hdr").read_bytes())
    failed = False
    for name in args.names or LIGHTS:
        light, tolerance = LIGHTS[name]
        (directory / "room.toml").write_text(f'{SIDECAR}[[lights]]\nname = "lamp"\n{light}')
        (directory / "lights.toml").write_text("schema = 1\n[background]\nvalue = 0.5\n")
        scene, lights = directory / "room.obj", ("--lights", directory / "lights.toml")
        run(args.program, "render", scene, *lights, "--spp", args.spp, "--max-depth", MAX_DEPTH, "-o",
            directory / f"{name}_ours.exr")
        ours = pixels(directory / f"{name}_ours.exr")
        script = directory / f"{name}.py"
        run(args.program, "export", "--format", "blender", "--whole", *lights, "-o", script, scene)
        for form, ending, read in [("blender", "py", read_blender), ("usd", "usda", read_usd),
                                   ("gltf", "gltf", read_gltf)]:
            expected = OTHERWISE.get((form, name), (1.0, tolerance))
            out = directory / f"{name}.{ending}"
            run(args.program, "export", "--format", form, "--whole", *lights, "-o", out, scene)
            read(out)
            if form != "blender":
                camera_of(script)
            for ob in bpy.data.objects:
                if ob.type == "LIGHT" and hasattr(ob.data, "use_soft_falloff"):
                    ob.data.use_soft_falloff = False
            diffuse()
            theirs = cycles(directory / f"{name}_{form}.exr", args.spp, 1)
            ratio = ours.mean() / theirs.mean()
            fine = expected is None or abs(ratio / expected[0] - 1) <= expected[1]
            difference = np.abs(ours - theirs).mean() / ours.mean()
            said = "ok" if fine else "DIFFERS"
            print(f"{name:10} {form:8} ours/Cycles {ratio:.4f}  mean difference {difference:.4f}  "
                  f"{'not compared' if expected is None else said}", flush=True)
            failed |= not fine
        checked = usd_is_valid(directory / f"{name}.usda")
        print(f"{name:10} usd-core {(checked.stdout or checked.stderr).strip()}", flush=True)
        failed |= checked.returncode != 0
    sys.exit(failed)


if __name__ == "__main__":
    main()
