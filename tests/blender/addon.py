#!/usr/bin/env python3
"""Tries the add-on end to end: scenes made in Blender, their lights found, applied, and rendered in Cycles.

    python3.11 -m venv target/blender && target/blender/bin/pip install -r tests/blender/requirements.txt
    cargo build --release && target/blender/bin/python tests/blender/addon.py

The add-on is packed and installed as a user does it. Cycles' picture is then measured by the formulas of the
paper, written here once more: f_q must be what the program told within 0.02, and the picture's mean that of
`final.exr` within 2 % (with diffuse materials alone within 0.01 and 0.5 %). One line a scene; exit status 1
when one is not.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
import tomllib
from pathlib import Path

# A Blender that has never been used; it is asked for when bpy is imported.
os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp()

import bpy  # noqa: E402
import numpy as np  # noqa: E402
import OpenEXR  # noqa: E402

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE))
import scenes  # noqa: E402


def parts(path):
    """Channels of a picture by part: of the first part, R G B as one array."""
    return {p.name(): p.channels for p in OpenEXR.File(str(path), separate_channels=True).parts}


def rgb(channels):
    return np.stack([channels[c].pixels for c in "RGB"], -1).astype(np.float64)


def shown(png):
    """Display luminance of a 16-bit PNG: sRGB of the luminance of its linear light."""
    image = bpy.data.images.load(str(png), check_existing=False)
    image.colorspace_settings.name = "Non-Color"
    w, h = image.size
    code = np.empty(4 * w * h, np.float32)
    image.pixels.foreach_get(code)
    bpy.data.images.remove(image)
    code = code.reshape(h, w, 4)[::-1, :, :3].astype(np.float64)
    linear = np.where(code <= 0.04045, code / 12.92, ((code + 0.055) / 1.055) ** 2.4)
    return encoded(linear @ np.array([0.2126, 0.7152, 0.0722]))


def encoded(y):
    """sRGB encoding of light in [0, 1]."""
    y = np.clip(y, 0.0, 1.0)
    return np.where(y <= 0.0031308, 12.92 * y, 1.055 * np.maximum(y, 1e-12) ** (1 / 2.4) - 0.055)


def brightness(path):
    """Display luminance of a picture by Cycles. Through Standard it is that of its linear light, clipped as a whole;
    through other views that of the picture that is shown."""
    scene = bpy.context.scene
    if scene.view_settings.view_transform != "Standard":
        return shown(path.with_suffix(".png"))
    linear = rgb(list(parts(path.with_suffix(".exr")).values())[0])
    return encoded(linear @ np.array([0.2126, 0.7152, 0.0722]) * 2.0**scene.view_settings.exposure)


def f_q(l, mask, target):
    """f_q of display luminance: PG14, equations 1 to 8."""
    up = np.pad(l, 1, mode="edge")
    gx = (up[:-2, 2:] - up[:-2, :-2]) + 2 * (up[1:-1, 2:] - up[1:-1, :-2]) + (up[2:, 2:] - up[2:, :-2])
    gy = (up[2:, :-2] - up[:-2, :-2]) + 2 * (up[2:, 1:-1] - up[:-2, 1:-1]) + (up[2:, 2:] - up[:-2, 2:])
    values = {
        "meanObj": l[mask].mean(), "meanBack": l[~mask].mean(), "varObj": l[mask].std(), "varBack": l[~mask].std(),
        "grad": np.sqrt((gx**2 + gy**2)[mask].mean()),
    }
    edges = np.arange(1, 257) / 256
    q = np.array([np.clip((e - l) * 256 + 0.5, 0, 1).mean() for e in edges])
    q[-1] = 1.0
    # Each modulus over the most that it can be.
    total = sum(target["weights"][k] * abs(v - (t := target[f"t_{k}"])) / max(t, 1.0 - t)
                for k, v in values.items())
    p = np.array(target["signature"]["cumulated"])
    return total + target["weights"]["hist"] * target["distance"](p, q), values


def target_of(run):
    """The look of a run, its signature as numbers."""
    record = tomllib.loads((run / "run.toml").read_text())
    return record["target"], record


def install(directory):
    """Packs and installs the add-on, and returns its module."""
    archive = directory / "lightopt_embree.zip"
    subprocess.run([sys.executable, str(ROOT / "blender/make.py"), "-o", str(archive)], check=True, stdout=subprocess.DEVNULL)
    bpy.ops.extensions.package_install_files(filepath=str(archive), repo="user_default", enable_on_install=True,
                                             overwrite=True)
    name = "bl_ext.user_default.lightopt_embree"
    bpy.context.preferences.addons[name]
    return name


def cycles(path, spp):
    """Renders the scene as a user's final picture: linear as EXR and through its view as PNG."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    c = scene.cycles
    c.samples, c.use_denoising, c.use_adaptive_sampling = spp, False, False
    c.max_bounces, c.diffuse_bounces, c.glossy_bounces, c.transmission_bounces = 6, 6, 6, 6
    c.sample_clamp_direct = c.sample_clamp_indirect = c.light_sampling_threshold = c.blur_glossy = 0
    c.pixel_filter_type, c.filter_width = "BOX", 1.0
    settings = scene.render.image_settings
    for kind, depth, ending in (("OPEN_EXR", "32", "exr"), ("PNG", "16", "png")):
        settings.file_format, settings.color_depth, settings.color_mode = kind, depth, "RGB"
        if ending == "exr":
            scene.render.filepath = str(path.with_suffix(".exr"))
            bpy.ops.render.render(write_still=True)
        else:
            bpy.data.images["Render Result"].save_render(str(path.with_suffix(".png")))


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", default=str(ROOT / "target/release/lightopt-embree"))
    parser.add_argument("--spp", type=int, default=512)
    parser.add_argument("--look", default="high-key")
    parser.add_argument("--more", default="--final-spp 192 --work-size 64x48")
    parser.add_argument("--lamps", type=int, default=0, help="lamps that the program places")
    parser.add_argument("--move", action="store_true", help="let the scene's lamps be moved")
    parser.add_argument("--keep", type=Path)
    parser.add_argument("names", nargs="*")
    args = parser.parse_args()
    directory = (args.keep or Path(tempfile.mkdtemp())).resolve()
    directory.mkdir(parents=True, exist_ok=True)
    failed = False
    for name in args.names or scenes.SCENES:
        build, is_diffuse = scenes.SCENES[name]
        build()
        install(directory)
        failed |= not try_scene(args, directory, name, is_diffuse)
    sys.exit(failed)


def try_scene(args, directory, name, is_diffuse):
    folder = directory / name
    folder.mkdir(exist_ok=True)
    scene = bpy.context.scene
    module = sys.modules["bl_ext.user_default.lightopt_embree"]
    bpy.context.preferences.addons[module.__name__].preferences.program = args.program
    s = scene.lightopt
    s.folder, s.look, s.more = str(folder), args.look, args.more
    s.lamps, s.position = args.lamps, args.move
    s.main = bpy.data.collections.get("subject")
    cycles(folder / "before", 64)
    begun = time.time()
    bpy.ops.lightopt.find()
    run = module.operators.RUN["run"]
    status = run.wait()
    module.operators.tick()
    lost = [line.text for line in s.lost]
    print(f"{name}: {s.said}, {time.time() - begun:.0f} s; not carried: {lost}", flush=True)
    if status != 0:
        return False
    bpy.ops.lightopt.apply()
    cycles(folder / "after", args.spp)
    target, record = target_of(folder / "run")
    ours = parts(folder / "run/final.exr")
    linear, theirs = rgb(ours["rgb"]), rgb(list(parts(folder / "after.exr").values())[0])
    mask = ours["mask"]["mask"].pixels > 0.5
    about = json.loads(subprocess.run([args.program, "evaluate", "--json", str(folder / "run/final.exr")],
                                      capture_output=True, text=True, check=True).stdout)
    target = module_target(target)
    measured, values = f_q(brightness(folder / "after"), mask, target)
    ratio = linear.mean() / theirs.mean()
    limits = (0.01, 0.005) if is_diffuse else (0.02, 0.02)
    fine = abs(measured - about["f_q"]) <= limits[0] and abs(ratio - 1) <= limits[1]
    told = {k: round(v["value"], 4) for k, v in about["terms"].items() if v.get("value") is not None}
    print(f"{name}: f_q told {about['f_q']:.4f}, in Cycles {measured:.4f}; mean ours/Cycles {ratio:.4f}; "
          f"{'ok' if fine else 'DIFFERS'}\n  told {told}\n  Cycles {({k: round(v, 4) for k, v in values.items()})}",
          flush=True)
    bpy.ops.lightopt.back()
    cycles(folder / "back", 64)
    before, back = (rgb(list(parts(folder / f"{w}.exr").values())[0]) for w in ("before", "back"))
    returned = np.abs(before - back).max() <= 1e-4 * before.max()
    print(f"{name}: back as before: {returned}", flush=True)
    return fine and returned


def module_target(target):
    """The target with its signature as a list, and the distance of equation 8."""
    signature = target["signature"]
    if "betas" in signature:
        from math import lgamma

        x = (np.arange(256 * 64) + 0.5) / (256 * 64)
        density = np.zeros_like(x)
        for b in signature["betas"]:
            m, v = b["mean"], b["sigma"] ** 2
            n = m * (1 - m) / v - 1
            a, c = m * n, (1 - m) * n
            logs = lgamma(a + c) - lgamma(a) - lgamma(c) + (a - 1) * np.log(x) + (c - 1) * np.log1p(-x)
            density += b["fraction"] * np.exp(logs)
        cumulated = np.cumsum(density)[63::64] / density.sum()
        signature = {"cumulated": cumulated}
    return {**target, "signature": signature, "distance": lambda p, q: np.sqrt(
        ((np.sqrt(p) - np.sqrt(q)) ** 2).sum() / (0.5 + np.abs(q - 0.5)).sum())}


if __name__ == "__main__":
    main()
