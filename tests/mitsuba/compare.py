#!/usr/bin/env python3
"""Compares our pictures with Mitsuba 3's, scene by scene.

    python3 -m venv target/mitsuba && target/mitsuba/bin/pip install -r tests/mitsuba/requirements.txt
    cargo build --release && target/mitsuba/bin/python tests/mitsuba/compare.py

Each scene is exported by the program, rendered by both with several seeds, and judged by
statistics: every pixel and channel by a z-test at level 0.01 with Sidak correction, and the
mean of the picture within 0.3 %. One line a scene; exit status 1 when one differs. On failure
both pictures and the map of z are written to target/test-out/mitsuba.

The variances are those of the means over the seeds, not below the picture's median, nor below
what the other program's samples leave if they are as few; with so few seeds a ratio follows Student's t, so it is first turned
into the normal deviate of the same probability.

Rough models get the light between their facets that this program has and Mitsuba lacks (facets.py), so
that what is compared is transport, down to a pixel; `--single` leaves them as the export has them.

Mitsuba's vectorised variant asks LLVM for an instruction (`fminimum`) that LLVM 14 and 15 do not have for x86: the
process is aborted. `DRJIT_LIBLLVM_PATH` chooses a newer one; a path to nothing leaves the scalar variant.
"""

import argparse
import json
import math
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import NormalDist

import mitsuba as mi
import numpy as np
import OpenEXR

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
ALPHA = 0.01
MAX_MEAN_DIFFERENCE = 0.003
# A mean known no better than this cannot be judged.
MAX_MEAN_ERROR = 0.001
# Seed of Mitsuba's first render; the others follow.
FIRST_SEED = 7000
# Reference pictures: where, their size, and their samples over those of a comparison.
REFERENCES = HERE / "references"
REFERENCE_SIZE = "32x24"
REFERENCE_FACTOR = 4

# Name: samples per pixel of a seed, ours and Mitsuba's. Noisy scenes have more.
SCENES = {
    "cornell": (64, 256),
    "glossy_floor": (64, 256),
    "smooth_plastic": (64, 256),
    "rough_conductor": (64, 256),
    "caustic": (384, 1536),
    "smooth_glass": (128, 512),
    "rough_glass": (64, 256),
    "smooth_normals": (64, 256),
    "lights_in_line": (64, 256),
    "textured": (64, 256),
    "point_light": (64, 256),
    "environment": (64, 256),
    "overcast": (64, 256),
    "spot": (64, 256),
    "sun": (64, 256),
    "shining_mesh": (64, 256),
    "thin_lens": (64, 256),
    "normal_mapped": (64, 256),
    "cutout": (64, 256),
    "metallic_blend": (64, 256),
    "fruit_basket": (96, 192),
}


class Moments:
    """Mean and variance of the mean over equal renders, per pixel and of the whole picture."""

    def __init__(self, images, spp):
        stack = np.stack([i.astype(np.float64) for i in images])
        n = len(stack)
        self.n = n
        self.samples = n * spp
        self.mean = stack.mean(0)
        self.variance = stack.var(0, ddof=1) / n
        totals = stack.mean((1, 2, 3))
        self.total = totals.mean()
        self.total_variance = totals.var(ddof=1) / n


def scene_file(name):
    ours = HERE / "scenes" / f"{name}.obj"
    return ours if ours.exists() else ROOT / "scenes" / f"{name}.obj"


def run(program, *args):
    done = subprocess.run([program, *map(str, args)], capture_output=True, text=True)
    if done.returncode != 0:
        sys.exit(f"{program} {' '.join(map(str, args))}: {done.stderr.strip()}")


def ours(program, name, size, spp, seeds, integrator, directory):
    images = []
    for seed in range(seeds):
        path = directory / "ours.exr"
        run(program, "render", scene_file(name), f"--{integrator}", "--size", size, "--spp", spp,
            "--seed", 1000 + seed, "-o", path)
        channels = OpenEXR.File(str(path), separate_channels=True).parts[0].channels
        images.append(np.stack([channels[c].pixels for c in "RGB"], axis=-1))
    return Moments(images, spp)


def theirs(args, name, size, spp, directory):
    out = directory / name
    run(args.program, "export", "--format", "mitsuba", "--size", size, "-o", out, scene_file(name))
    path = out / "scene.xml"
    if not args.single:
        import facets  # Its class can only be made once Mitsuba's variant is chosen.

        path = facets.prepare(path, scene_file(name).with_suffix(".mtl"))
    scene = mi.load_file(str(path))
    return Moments([np.array(mi.render(scene, spp=spp, seed=FIRST_SEED + seed))
                    for seed in range(args.seeds)], spp)


def normal_deviate(t, dof):
    """The normal deviate as probable as Student's t: D. Wallace, Ann. Math. Stat. 30, 1959, eq. 4.3."""
    return np.sign(t) * (8 * dof + 1) / (8 * dof + 3) * np.sqrt(dof * np.log1p(t * t / dof))


def z_map(a, b):
    # Renders that all missed what is rarely seen have hardly any variance: each program's is at
    # least what the other's samples have if they are as few.
    ratio = b.samples / a.samples
    variance = np.maximum(a.variance, b.variance * ratio) + np.maximum(b.variance, a.variance / ratio)
    floor = max(np.median(variance), 1e-30)
    # Welch's degrees of freedom; those of a pixel at the floor are many.
    dof = np.maximum(variance, floor) ** 2 / np.maximum(
        a.variance**2 / (a.n - 1) + b.variance**2 / (b.n - 1), 1e-60)
    return normal_deviate((a.mean - b.mean) / np.sqrt(np.maximum(variance, floor)), np.minimum(dof, 1e6))


def write_failure(name, a, b, z):
    directory = ROOT / "target" / "test-out" / "mitsuba"
    directory.mkdir(parents=True, exist_ok=True)
    zc = z.mean(-1)
    pictures = {"ours": a.mean, "mitsuba": b.mean, "z": np.stack([zc, abs(zc) * 0, -zc], -1) / 5}
    for kind, picture in pictures.items():
        bitmap = mi.Bitmap(np.maximum(picture, 0).astype(np.float32))
        bitmap.convert(mi.Bitmap.PixelFormat.RGB, mi.Struct.Type.UInt8, True).write(
            str(directory / f"{name}-{kind}.png"))


def compare(args, name, directory):
    start = time.monotonic()
    our_spp, their_spp = (max(32, int(n * args.scale)) for n in SCENES[name])
    a = ours(args.program, name, args.size, our_spp, args.seeds, args.integrator, directory)
    middle = time.monotonic()
    b = theirs(args, name, args.size, their_spp, directory)
    end = time.monotonic()

    z = z_map(a, b)
    n = z.size
    threshold = NormalDist().inv_cdf(1 - (1 - (1 - ALPHA) ** (1 / n)) / 2)
    worst = np.abs(z).max()
    within = np.mean(np.abs(z) < NormalDist().inv_cdf(1 - ALPHA / 2))
    difference = a.total / b.total - 1
    errors = [math.sqrt(m.total_variance) / b.total for m in (a, b)]
    error = math.hypot(*errors)
    faults = []
    if worst > threshold:
        faults.append(f"{np.count_nonzero(np.abs(z) > threshold)} values differ")
    if abs(difference) > MAX_MEAN_DIFFERENCE + (3 * error if args.quick else 0):
        faults.append("means differ")
    if error > MAX_MEAN_ERROR and not args.quick:
        faults.append("too noisy to judge the mean")
    print(f"{name:<16} {100 * difference:+8.3f} % {100 * error:6.3f} % ({100 * errors[0]:.3f}, {100 * errors[1]:.3f}) "
          f"{100 * within:9.2f} % {np.sqrt(np.mean(z * z)):7.3f} {worst:8.2f} {threshold:6.2f} "
          f"{middle - start:6.0f} s {end - middle:6.0f} s  {'; '.join(faults) or 'same'}", flush=True)
    if faults:
        write_failure(name, a, b, z)
    return not faults


def write_reference(args, name, directory):
    """Mitsuba's mean and the variance of it, for tests that have no Mitsuba."""
    spp = REFERENCE_FACTOR * SCENES[name][1]
    start = time.monotonic()
    m = theirs(args, name, REFERENCE_SIZE, spp, directory)
    note = {
        "command": f"compare.py --write-references --only {name} --seeds {args.seeds}",
        "mitsuba": f"{mi.__version__} {mi.variant()}",
        "renders": args.seeds,
        "between_facets": not args.single,
        "seeds": [FIRST_SEED, FIRST_SEED + args.seeds - 1],
        "spp": spp,
        "variance_of_mean": m.total_variance,
    }
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage,
              "lightopt": json.dumps(note, sort_keys=True)}
    planes = {"": m.mean, "variance.": m.variance}
    channels = {prefix + c: np.ascontiguousarray(values[..., i].astype(np.float32))
                for prefix, values in planes.items() for i, c in enumerate("RGB")}
    REFERENCES.mkdir(exist_ok=True)
    OpenEXR.File(header, channels).write(str(REFERENCES / f"{name}.exr"))
    print(f"{name:<16} mean {m.total:.5f}, error {100 * math.sqrt(m.total_variance) / m.total:.3f} %, "
          f"{time.monotonic() - start:.0f} s", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", metavar="NAME", action="append", choices=SCENES, help="this scene (repeatable)")
    parser.add_argument("--quick", action="store_true", help="a quarter of the samples; means may differ by 3 standard errors more")
    parser.add_argument("--size", default="48x36", help="of the pictures (default 48x36)")
    parser.add_argument("--seeds", type=int, default=16, help="renders of each program (default 16)")
    parser.add_argument("--integrator", choices=["bdpt", "path"], default="bdpt", help="ours (default bdpt)")
    parser.add_argument("--single", action="store_true", help="Mitsuba's own rough models, without light between facets")
    parser.add_argument("--write-references", action="store_true",
                        help="only render with Mitsuba, into tests/mitsuba/references")
    parser.add_argument("--program", default=str(ROOT / "target" / "release" / "lightopt-embree"))
    args = parser.parse_args()
    args.scale = 0.25 if args.quick else 1.0

    try:
        mi.set_variant("llvm_ad_rgb")
        mi.Float(0.0) + 1.0
    except (ImportError, RuntimeError):
        mi.set_variant("scalar_rgb")
    mi.set_log_level(mi.LogLevel.Error)
    if args.write_references:
        with tempfile.TemporaryDirectory() as directory:
            for name in args.only or [n for n in SCENES if (HERE / "scenes" / f"{n}.obj").exists()]:
                write_reference(args, name, Path(directory))
        return
    print(f"Mitsuba {mi.__version__} {mi.variant()}, {args.size}, {args.seeds} seeds, ours: {args.integrator}")
    print("scene            difference   error   (ours, Mitsuba)  within 99%   rms z  worst z  limit     ours  mitsuba")
    start = time.monotonic()
    with tempfile.TemporaryDirectory() as directory:
        same = [compare(args, name, Path(directory)) for name in args.only or SCENES]
    print(f"{sum(same)} of {len(same)} scenes agree, {time.monotonic() - start:.0f} s")
    sys.exit(0 if all(same) else 1)


if __name__ == "__main__":
    main()
