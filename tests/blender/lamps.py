#!/usr/bin/env python3
"""Compares our pictures with Cycles', lamp by lamp, for scenes that the add-on writes.

    python3.11 -m venv target/blender && target/blender/bin/pip install -r tests/blender/requirements.txt
    cargo build --release && target/blender/bin/python tests/blender/lamps.py

Each line is a lamp, or a world, as users set them: with colours, temperatures, exposures, scaled objects, Normalize
off. It is written by the add-on into a scene of diffuse materials, and rendered by the program and in Cycles; the
ratio of the means must be 1 within the tolerance of the line.
"""

import argparse
import subprocess
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
from lightopt_embree import export  # noqa: E402

AT = (1.1, -0.9, 2.2)


def lamp(kind, scale=(1, 1, 1), **settings):
    def make():
        ob = scenes.lamp(kind, "lamp", AT, target=(0, 0, 0.3), **settings)
        ob.scale = scale
        bpy.context.view_layer.update()

    return make


def world(color=(1, 1, 1), strength=1.0):
    def make():
        w = bpy.context.scene.world = bpy.data.worlds.new("World")
        node = next(n for n in w.node_tree.nodes if n.type == "BACKGROUND")
        node.inputs["Color"].default_value, node.inputs["Strength"].default_value = (*color, 1), strength

    return make


def shared():
    """A lamp in a collection that is instanced twice."""
    ob = scenes.lamp("POINT", "lamp", (0, 0, 0), energy=30.0, shadow_soft_size=0.1, use_soft_falloff=False)
    group = bpy.data.collections.new("group")
    bpy.context.scene.collection.objects.unlink(ob)
    group.objects.link(ob)
    for i, x in enumerate((-1.2, 1.2)):
        instance = bpy.data.objects.new(f"place {i}", None)
        instance.instance_type, instance.instance_collection, instance.location = "COLLECTION", group, (x, -1, 1.8)
        bpy.context.scene.collection.objects.link(instance)


# Name: what makes the lamp, and the tolerance.
LAMPS = {
    "square": (lamp("AREA", shape="SQUARE", size=0.8, energy=60.0), 0.005),
    "rectangle": (lamp("AREA", shape="RECTANGLE", size=1.2, size_y=0.4, energy=60.0, color=(1, 0.5, 0.2)), 0.005),
    "scaled": (lamp("AREA", scale=(1.5, 0.5, 2.0), shape="RECTANGLE", size=0.8, size_y=0.8, energy=60.0), 0.005),
    "disk": (lamp("AREA", shape="DISK", size=0.7, energy=60.0), 0.005),
    "ellipse": (lamp("AREA", shape="ELLIPSE", size=0.9, size_y=0.4, energy=60.0), 0.01),
    "area_raw": (lamp("AREA", shape="SQUARE", size=0.8, energy=60.0, normalize=False), 0.005),
    "warm": (lamp("AREA", shape="SQUARE", size=0.8, energy=60.0, use_temperature=True, temperature=3000.0,
                  exposure=0.7), 0.005),
    "ball": (lamp("POINT", shadow_soft_size=0.2, energy=60.0, use_soft_falloff=False), 0.005),
    "ball_raw": (lamp("POINT", shadow_soft_size=0.2, energy=60.0, use_soft_falloff=False, normalize=False), 0.005),
    "ball_scaled": (lamp("POINT", scale=(2, 2, 2), shadow_soft_size=0.1, energy=60.0, use_soft_falloff=False), 0.005),
    # Soft falloff, which Apply turns off, is a disk that faces what it lights.
    "ball_soft": (lamp("POINT", shadow_soft_size=0.2, energy=60.0), 0.035),
    "point": (lamp("POINT", shadow_soft_size=0.0, energy=60.0), 0.005),
    "spot": (lamp("SPOT", shadow_soft_size=0.0, energy=90.0, spot_size=1.1, spot_blend=0.6), 0.005),
    "spot_ball": (lamp("SPOT", shadow_soft_size=0.1, energy=90.0, spot_size=1.1, spot_blend=0.6,
                       use_soft_falloff=False), 0.01),
    "sun": (lamp("SUN", energy=2.0, angle=0.0), 0.005),
    "sun_disk": (lamp("SUN", energy=2.0, angle=0.2), 0.005),
    "sun_raw": (lamp("SUN", energy=2.0, angle=0.2, normalize=False), 0.005),
    "world": (world((0.4, 0.6, 1.0), 0.8), 0.005),
    "shared": (shared, 0.005),
}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", default=str(ROOT / "target/release/lightopt-embree"))
    parser.add_argument("--spp", type=int, default=512)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("names", nargs="*")
    args = parser.parse_args()
    directory = args.keep or Path(tempfile.mkdtemp())
    failed = False
    for name in args.names or LAMPS:
        make, tolerance = LAMPS[name]
        scenes.empty("Standard")
        scenes.sweep(scenes.material("paper", (0.6, 0.6, 0.6)), width=4, front=2, back=1.6, height=2.5, radius=0.6)
        cube = scenes.add("cube", "cube", (-0.3, 0.1, 0.4), scenes.material("blue", (0.2, 0.3, 0.7)), scale=0.4)
        make()
        scenes.camera((0.4, -4.2, 1.6), (0, 0, 0.6), compare.SIZE)
        scenes.select(cube)
        lost = export.write(bpy.context, str(directory / name))
        compare.run(args.program, "render", directory / name / "scene.glb", "--spp", args.spp, "--max-depth",
                    compare.MAX_DEPTH, "-o", directory / name / "ours.exr")
        ours = compare.pixels(directory / name / "ours.exr")
        theirs = compare.cycles(directory / name / "cycles.exr", args.spp, 1)
        ratio = ours.mean() / theirs.mean()
        channels = np.abs(ours.mean((0, 1)) / theirs.mean((0, 1)) / ratio - 1).max()
        fine = abs(ratio - 1) <= tolerance and channels <= 0.01
        print(f"{name:12} ours/Cycles {ratio:.4f}  colour off by {channels:.4f}  {'ok' if fine else 'DIFFERS'}  {lost}",
              flush=True)
        failed |= not fine
    sys.exit(failed)


if __name__ == "__main__":
    main()
