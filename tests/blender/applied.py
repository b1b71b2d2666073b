#!/usr/bin/env python3
"""Compares our pictures with Cycles' after Apply, key by key of lights.toml, and camera by camera.

    python3.11 -m venv target/blender && target/blender/bin/pip install -r tests/blender/requirements.txt
    cargo build --release && target/blender/bin/python tests/blender/applied.py

Each line is a lamp of Blender with a lights.toml that changes one thing of it: power, size, colour, place, the world,
base colours, exposure. The add-on writes the scene, the program renders it with that file, Apply sets it in Blender, and
Cycles renders. Means must agree within the tolerance of the line, and after Back the scene must be as before. Lines of
cameras change nothing: pictures must agree pixel by pixel, within their noise.
"""

import argparse
import math
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path[:0] = [str(HERE), str(ROOT / "blender")]
import compare  # noqa: E402
import scenes  # noqa: E402
from lightopt_embree import export, results  # noqa: E402

AT = (1.1, -0.9, 2.2)
# A colour of luminance 1.
RED = [2.0, 0.7427, 0.603]


def lamp(kind, **settings):
    return lambda: scenes.lamp(kind, "lamp", AT, target=(0, 0, 0.3), **settings)


def light(**keys):
    """The table of the lamp in a lights.toml."""
    lines = "".join(f"{k} = {v}\n" for k, v in keys.items() if k != "placed")
    placed = keys.get("placed")
    inner = "" if placed is None else "[lights.placed]\n" + "".join(f"{k} = {v}\n" for k, v in placed.items())
    return f'[[lights]]\nname = "lamp"\n{lines}{inner}'


def world():
    w = bpy.context.scene.world = bpy.data.worlds.new("World")
    node = next(n for n in w.node_tree.nodes if n.type == "BACKGROUND")
    node.inputs["Color"].default_value = (0.4, 0.6, 1.0, 1)


def with_world():
    AREA()
    world()


def sky():
    """A picture of surroundings, beside the scene, whose path the program writes whole."""
    return str(ROOT / "tests/mitsuba/scenes/sky.hdr")


def emitter():
    ball = scenes.add("uv_sphere", "shine", (0.9, -0.4, 0.3), scale=0.2)
    material = bpy.data.materials.new("glow")
    node = next(n for n in material.node_tree.nodes if n.type == "BSDF_PRINCIPLED")
    node.inputs["Emission Color"].default_value, node.inputs["Emission Strength"].default_value = (1, 0.5, 0.2, 1), 2.0
    ball.data.materials.append(material)


AREA = lamp("AREA", shape="RECTANGLE", size=0.8, size_y=0.5, energy=60.0)
BALL = lamp("POINT", shadow_soft_size=0.15, energy=60.0)
SPOT = lamp("SPOT", shadow_soft_size=0.0, energy=90.0, spot_size=1.1, spot_blend=0.6)
PLACE = {"position": [-1.0, 2.0, 1.0], "look_at": [-0.3, 0.3, 0.0]}
# Name: what makes the lamps, the text of lights.toml, and the tolerance.
APPLIED = {
    "power": (AREA, light(radiance=20), 0.005),
    "size": (AREA, light(radiance=5, size=2.5), 0.005),
    "colour": (AREA, light(radiance=5, color=RED), 0.005),
    "warm_colour": (lamp("AREA", shape="SQUARE", size=0.8, energy=60.0, use_temperature=True, temperature=3000.0,
                         exposure=0.7), light(radiance=5, color=RED, size=0.5), 0.005),
    "warm_power": (lamp("AREA", shape="SQUARE", size=0.8, energy=60.0, use_temperature=True, temperature=3000.0,
                        exposure=0.7), light(radiance=5), 0.005),
    "raw_size": (lamp("AREA", shape="SQUARE", size=0.8, energy=60.0, normalize=False), light(radiance=5, size=1.7), 0.005),
    "disk": (lamp("AREA", shape="DISK", size=0.7, energy=60.0), light(radiance=8, size=1.6, color=RED), 0.005),
    "ellipse": (lamp("AREA", shape="ELLIPSE", size=0.9, size_y=0.4, energy=60.0), light(radiance=8, size=1.6), 0.01),
    "ball": (BALL, light(radiance=8, size=2.0, color=RED), 0.005),
    "point": (lamp("POINT", shadow_soft_size=0.0, energy=60.0), light(radiance=3, color=RED), 0.005),
    "spot": (SPOT, light(radiance=6, color=RED), 0.005),
    "spot_ball": (lamp("SPOT", shadow_soft_size=0.1, energy=90.0, spot_size=1.1, spot_blend=0.6),
                  light(radiance=200, size=1.5), 0.01),
    "sun": (lamp("SUN", energy=2.0, angle=0.0), light(radiance=3, color=RED), 0.005),
    "sun_disk": (lamp("SUN", energy=2.0, angle=0.1), light(radiance=60, size=2.0), 0.005),
    "world": (world, '[[lights]]\nname = "World"\nradiance = 1.5\n', 0.005),
    "emitter": (emitter, '[[lights]]\nname = "glow"\nradiance = 6\n', 0.01),
    "background": (AREA, "[background]\nvalue = 0.5\n" + light(radiance=10), 0.005),
    "exposure": (AREA, "exposure = 3.0\n" + light(radiance=10), 0.005),
    "moved": (AREA, light(radiance=5, placed={"type": '"rectangle"', "half_extents": [0.4, 0.25], **PLACE}), 0.005),
    "placed_disk": (AREA, light(radiance=5, size=1.5, placed={"type": '"disk"', "radius": 0.3, **PLACE}), 0.005),
    "placed_spot": (AREA, light(radiance=300, placed={"type": '"spot"', "radius": 0.05, "angle": 35, "softness": 0.3,
                                                      **PLACE}), 0.01),
}
SKY = {"type": '"environment"', "image": f'"{sky()}"', "rotation": 130}
APPLIED |= {
    # Lamps in the place of all that the scene has.
    "alone": (with_world, "without_lights = true\n" + light(radiance=5, placed={
        "type": '"rectangle"', "half_extents": [0.4, 0.25], **PLACE}).replace('"lamp"', '"key"'), 0.005),
    "surroundings": (with_world, "without_lights = true\n" + light(radiance=0.7, placed=SKY)
                     .replace('"lamp"', '"sky"'), 0.005),
}


def camera(size, fit="AUTO", percentage=100, lens=35.0, shift=(0, 0), sensor=(36.0, 24.0), focus=None):
    def make(directory):
        view = scenes.camera((0.4, -4.2, 1.6), (0, 0, 0.6), size, lens=lens, shift=shift, fit=fit)
        view.data.sensor_width, view.data.sensor_height = sensor
        bpy.context.scene.render.resolution_percentage = percentage
        if focus is not None:
            view.data.dof.use_dof = True
            view.data.dof.focus_distance, view.data.dof.aperture_fstop = focus

    return make


CAMERAS = {
    "auto_wide": camera((96, 64), shift=(0.1, -0.05)),
    "auto_tall": camera((64, 96), shift=(0.1, -0.05)),
    "horizontal_wide": camera((96, 64), "HORIZONTAL", shift=(-0.08, 0.04)),
    "horizontal_tall": camera((64, 96), "HORIZONTAL", shift=(-0.08, 0.04), lens=50.0),
    "vertical_wide": camera((96, 64), "VERTICAL", shift=(-0.08, 0.04), lens=28.0),
    "vertical_tall": camera((64, 96), "VERTICAL", shift=(-0.08, 0.04)),
    "percentage": camera((192, 129), percentage=50, shift=(0.05, 0.0)),
    "lens": camera((96, 64), lens=85.0, focus=(3.4, 0.3)),
}


def stage(directory):
    scenes.empty("Standard")
    scenes.sweep(scenes.material("paper", (0.6, 0.6, 0.6)), width=4, front=2, back=1.6, height=2.5, radius=0.6)
    return scenes.add("cube", "cube", (-0.3, 0.1, 0.4), scenes.material("blue", (0.2, 0.3, 0.7)), scale=0.4)


def state():
    """All that Apply may set."""
    scene = bpy.context.scene
    out = {"exposure": scene.view_settings.exposure}
    for ob in scene.objects:
        if ob.type == "LIGHT":
            out[ob.name] = (*(tuple(row) for row in ob.matrix_world), ob.data.energy, tuple(ob.data.color),
                            *(getattr(ob.data, k, None) for k in results.SETTINGS if k != "color"))
    for m in bpy.data.materials:
        for n in m.node_tree.nodes:
            out[m.name, n.name] = [tuple(s.default_value) if hasattr(s.default_value, "__len__") else s.default_value
                                   for s in n.inputs if s.enabled and hasattr(s, "default_value")]
    if scene.world:
        out["world"] = [(n.name, n.inputs["Strength"].default_value) for n in scene.world.node_tree.nodes
                        if n.type == "BACKGROUND"]
    return out


def close(a, b):
    if isinstance(a, (list, tuple)):
        return len(a) == len(b) and all(close(x, y) for x, y in zip(a, b))
    return a == b or isinstance(a, float) and isinstance(b, float) and abs(a - b) <= 1e-5 * max(1.0, abs(a))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", default=str(ROOT / "target/release/lightopt-embree"))
    parser.add_argument("--spp", type=int, default=384)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("names", nargs="*")
    args = parser.parse_args()
    directory = args.keep or Path(tempfile.mkdtemp())
    names = args.names or [*APPLIED, *CAMERAS]
    failed = [name for name in names if not (applied if name in APPLIED else seen)(args, directory / name, name)]
    sys.exit(bool(failed))


def render(args, folder, *more):
    compare.run(args.program, "render", folder / "scene.glb", *more, "--spp", args.spp, "--max-depth", compare.MAX_DEPTH,
                "-o", folder / "ours.exr")
    return compare.pixels(folder / "ours.exr")


def applied(args, folder, name):
    make, text, tolerance = APPLIED[name]
    cube = stage(folder)
    make()
    compare.SIZE = (64, 48)
    scenes.camera((0.4, -4.2, 1.6), (0, 0, 0.6), compare.SIZE)
    bpy.context.view_layer.update()
    scenes.select(cube)
    export.write(bpy.context, str(folder))
    (folder / "lights.toml").write_text(f"schema = 1\n{text}")
    before = state()
    ours = render(args, folder, "--lights", folder / "lights.toml")
    by_hand = results.apply(bpy.context.scene, str(folder), str(folder / "lights.toml"))
    theirs = compare.cycles(folder / "cycles.exr", args.spp, 1)
    ratio = ours.mean() / theirs.mean()
    channels = np.abs(ours.mean((0, 1)) / theirs.mean((0, 1)) / ratio - 1).max()
    stops = bpy.context.scene.view_settings.exposure
    is_exposed = abs(stops - (math.log2(3.0) if name == "exposure" else 0.0)) < 1e-5
    results.back(bpy.context.scene)
    bpy.context.view_layer.update()
    returned = {k for k, v in state().items() if k not in before or not close(before[k], v)}
    fine = abs(ratio - 1) <= tolerance and channels <= 0.01 and is_exposed and not returned and not by_hand
    print(f"{name:16} ours/Cycles {ratio:.4f}  colour off by {channels:.4f}  back as before: {not returned} "
          f"{sorted(map(str, returned))}  {'ok' if fine else 'DIFFERS'}  {by_hand}", flush=True)
    return fine


def seen(args, folder, name):
    cube = stage(folder)
    world()
    CAMERAS[name](folder)
    bpy.context.view_layer.update()
    scenes.select(cube)
    export.write(bpy.context, str(folder))
    ours = render(args, folder)
    compare.SIZE = ours.shape[1::-1]
    theirs = compare.cycles(folder / "cycles.exr", args.spp, 1)
    if ours.shape != theirs.shape:
        print(f"{name:16} ours {ours.shape}, Cycles {theirs.shape}  DIFFERS", flush=True)
        return False
    ratio, off = ours.mean() / theirs.mean(), np.abs(ours - theirs).mean() / theirs.mean()
    # An edge that is off by a tenth of a pixel shows in this mean as some 0.01; noise is 0.006.
    fine = abs(ratio - 1) <= 0.005 and off <= 0.012
    print(f"{name:16} ours/Cycles {ratio:.4f}  pixels off by {off:.4f}  {'ok' if fine else 'DIFFERS'}", flush=True)
    return fine


if __name__ == "__main__":
    main()
