#!/usr/bin/env python3
"""Compares our pictures with Cycles', material by material, for scenes that the add-on writes.

    python3.11 -m venv target/blender && target/blender/bin/pip install -r tests/blender/requirements.txt
    cargo build --release && target/blender/bin/python tests/blender/materials.py

Each line is a material, as users set it, on a ball in a diffuse backdrop below a large lamp and a grey world. It is
written by the add-on and rendered by the program and in Cycles. The ratio of the means, of the ball alone and of the
whole picture, must be 1 within the tolerances of the line. Where Cycles' own model is another the ratio of the ball is
of that model, and the line says why.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import bpy
import numpy as np
import OpenEXR

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path[:0] = [str(HERE), str(ROOT / "blender")]
import compare  # noqa: E402
import scenes  # noqa: E402
from lightopt_embree import export  # noqa: E402

# Edges of the longest path: through glass light crosses many faces.
MAX_DEPTH = 8


def shader(kind, **inputs):
    """A material of one shader, with its inputs by their names, `_` for a blank."""
    def make():
        material = bpy.data.materials.new("skin")
        material.use_nodes = True
        tree = material.node_tree
        tree.nodes.clear()
        node = tree.nodes.new(f"ShaderNode{kind}")
        for name, value in inputs.items():
            node.inputs[name.replace("_", " ")].default_value = (*value, 1) if isinstance(value, tuple) else value
        tree.links.new(node.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
        return material

    return make


def principled(**inputs):
    return shader("BsdfPrincipled", **inputs)


COPPER, GREEN = (0.9, 0.55, 0.4), (0.3, 0.7, 0.5)
# Name: what makes the material, the ratio of the ball and its tolerance, the tolerance of the whole picture.
MATERIALS = {
    "diffuse": (shader("BsdfDiffuse", Color=GREEN), 1.0, 0.005, 0.004),
    "emission": (shader("Emission", Color=GREEN, Strength=1.5), 1.0, 0.005, 0.004),
    "emission_principled": (principled(Base_Color=GREEN, Emission_Color=COPPER, Emission_Strength=0.8),
                            1.0, 0.01, 0.004),
    "glossy": (shader("BsdfAnisotropic", Color=COPPER, Roughness=0.4), 1.0, 0.03, 0.005),
    "metallic": (shader("BsdfMetallic", Base_Color=COPPER, Edge_Tint=(1.0, 1.0, 1.0), Roughness=0.3), 1.0, 0.02, 0.005),
    "metallic_edge": (shader("BsdfMetallic", Base_Color=COPPER, Edge_Tint=(0.4, 0.5, 0.6), Roughness=0.3),
                      1.0, 0.02, 0.005),
    "metallic_mirror": (shader("BsdfMetallic", Base_Color=COPPER, Edge_Tint=(0.4, 0.5, 0.6), Roughness=0.0),
                        1.0, 0.005, 0.004),
    "metal": (principled(Base_Color=COPPER, Metallic=1.0, Roughness=0.3), 1.0, 0.02, 0.005),
    "metal_edge": (principled(Base_Color=COPPER, Metallic=1.0, Roughness=0.3, Specular_Tint=(0.5, 0.8, 1.0)),
                   1.0, 0.02, 0.005),
    # All at the defaults of glTF. As bright in a white room; above a dim floor Cycles, which scales the lobe of one
    # bounce for the light between facets, is darker than a lobe that is as wide as that light is.
    "metal_plain": (principled(Base_Color=(1.0, 1.0, 1.0), Metallic=1.0, Roughness=1.0), 1.05, 0.05, 0.015),
    "metal_rough": (principled(Base_Color=COPPER, Metallic=1.0, Roughness=0.7), 1.028, 0.02, 0.01),
    "half_metal": (principled(Base_Color=COPPER, Metallic=0.5, Roughness=0.4), 1.0, 0.02, 0.005),
    "plastic": (principled(Base_Color=GREEN, Roughness=0.3), 1.0, 0.02, 0.005),
    "plastic_rough": (principled(Base_Color=GREEN, Roughness=0.8), 1.0, 0.02, 0.005),
    "plastic_ior": (principled(Base_Color=GREEN, Roughness=0.3, IOR=1.8), 1.0, 0.02, 0.005),
    "plastic_level": (principled(Base_Color=GREEN, Roughness=0.3, Specular_IOR_Level=1.0), 1.0, 0.02, 0.005),
    "plastic_bare": (principled(Base_Color=GREEN, Roughness=0.3, Specular_IOR_Level=0.0), 1.0, 0.02, 0.005),
    "alpha": (principled(Base_Color=GREEN, Roughness=0.5, Alpha=0.6), 1.0, 0.02, 0.005),
    "glass": (shader("BsdfGlass", Color=(1.0, 1.0, 1.0), IOR=1.45, Roughness=0.0), 1.0, 0.015, 0.005),
    "glass_rough": (shader("BsdfGlass", Color=(1.0, 1.0, 1.0), IOR=1.45, Roughness=0.3), 1.0, 0.015, 0.005),
    "glass_tinted": (shader("BsdfGlass", Color=GREEN, IOR=1.45, Roughness=0.0), 1.0, 0.015, 0.005),
    "glass_principled": (principled(Base_Color=(0.8, 0.8, 0.8), Transmission_Weight=1.0, IOR=1.45, Roughness=0.0),
                         1.0, 0.015, 0.005),
    "glass_principled_rough": (principled(Base_Color=COPPER, Transmission_Weight=1.0, IOR=1.45, Roughness=0.3),
                               1.0, 0.015, 0.005),
    # An open surface is a sheet here, both faces at once, whose reflection has no colour; Cycles refracts at the one
    # face that is there, and tints what a Glass BSDF reflects.
    "pane": (principled(Base_Color=GREEN, Transmission_Weight=1.0, IOR=1.45, Roughness=0.0), 1.0, 0.02, 0.02),
    "pane_glass": (shader("BsdfGlass", Color=GREEN, IOR=1.45, Roughness=0.0), 1.04, 0.03, 0.03),
    # Rough glass of Cycles is dark: in a white room of brightness 1 such a ball has 0.981 there, and 0.997 here.
    "glass_frosted": (shader("BsdfGlass", Color=(1.0, 1.0, 1.0), IOR=1.45, Roughness=0.6), 1.03, 0.02, 0.005),
}


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", default=str(ROOT / "target/release/lightopt-embree"))
    parser.add_argument("--spp", type=int, default=512)
    parser.add_argument("--keep", type=Path)
    parser.add_argument("names", nargs="*")
    args = parser.parse_args()
    directory = args.keep or Path(tempfile.mkdtemp())
    compare.MAX_DEPTH = MAX_DEPTH
    failed = False
    for name in args.names or MATERIALS:
        make, expected, ball_tolerance, tolerance = MATERIALS[name]
        scenes.empty("Standard")
        scenes.sweep(scenes.material("paper", (0.6, 0.6, 0.6)), width=4, front=2, back=1.6, height=2.5, radius=0.6)
        if name.startswith("pane"):
            ball = scenes.add("plane", "pane", (0, -0.4, 0.6), make(), size=0.8)
            ball.rotation_euler.x = np.pi / 2
        else:
            ball = scenes.add("uv_sphere", "ball", (0, 0, 0.52), make(), scale=0.5, segments=64, ring_count=32)
            bpy.ops.object.shade_smooth()
        scenes.lamp("AREA", "lamp", (1.0, -1.4, 2.4), shape="SQUARE", size=1.6, energy=60.0)
        world = bpy.context.scene.world = bpy.data.worlds.new("World")
        background = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
        background.inputs["Color"].default_value = (0.5, 0.6, 0.8, 1)
        background.inputs["Strength"].default_value = 0.5
        scenes.camera((0.2, -3.0, 1.1), (0, 0, 0.55), compare.SIZE)
        scenes.select(ball)
        lost = export.write(bpy.context, str(directory / name))
        compare.run(args.program, "render", directory / name / "scene.glb", "--spp", args.spp, "--max-depth", MAX_DEPTH,
                    "-o", directory / name / "ours.exr")
        ours = compare.pixels(directory / name / "ours.exr")
        part = next(p for p in OpenEXR.File(str(directory / name / "ours.exr"), separate_channels=True).parts
                    if p.name() == "mask")
        mask = part.channels["mask"].pixels > 0.5
        theirs = compare.cycles(directory / name / "cycles.exr", args.spp, 1)
        ratio, whole = ours[mask].mean() / theirs[mask].mean(), ours.mean() / theirs.mean()
        channels = np.abs(ours[mask].mean(0) / theirs[mask].mean(0) / ratio - 1).max()
        fine = abs(ratio / expected - 1) <= ball_tolerance and abs(whole - 1) <= tolerance
        print(f"{name:24} ours/Cycles: ball {ratio:.4f}, colour off by {channels:.4f}, picture {whole:.4f}  "
              f"{'ok' if fine else 'DIFFERS'}  {lost}", flush=True)
        failed |= not fine
    sys.exit(failed)


if __name__ == "__main__":
    main()
