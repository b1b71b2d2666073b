"""Makes the tables of studio.ocio and the values that PyOpenColorIO has for its views.

    pip install opencolorio==2.6.0
    python reference.py
"""

import math
import pathlib

import PyOpenColorIO as ocio

HERE = pathlib.Path(__file__).parent
VIEWS = [("sRGB", "Film"), ("sRGB", "Plain"), ("sRGB", "Film: warm"), ("Projector", "Film")]
COLOURS = [
    (0, 0, 0), (1e-5, 2e-5, 1e-5), (0.001, 0.002, 0.0015), (0.18, 0.18, 0.18), (1, 1, 1), (4, 4, 4),
    (60, 60, 60), (1000, 900, 800), (0.5, 0, 0), (0, 0.5, 0), (0, 0, 0.5), (3, 0.01, 0), (0.02, 3, 5),
    (6, 0.01, 4), (0.3, 0.02, 0.25), (0.8, 0.5, 0.35), (0.02, 0.18, 0.3), (0.12, 0.1, 0.02), (30, 2, 1),
]


def film(t):
    """The curve: from logarithms to a code value."""
    return 1 / (1 + math.exp(-9 * (t - 0.55)))


def print_stock(r, g, b):
    """The lattice: a little of every channel in the others, more where it is bright."""
    grey = (r + g + b) / 3
    keep = 1 - 0.25 * grey * grey
    return tuple(grey + keep * (v - grey) for v in (r, g, b))


def write_tables():
    n = 65
    lines = [f"{film(i / (n - 1)):.7f}" for i in range(n)]
    head = f"Version 1\nFrom 0.0 1.0\nLength {n}\nComponents 1\n"
    (HERE / "luts/film.spi1d").write_text(head + "{\n" + "\n".join(lines) + "\n}\n")
    n = 5
    steps = [i / (n - 1) for i in range(n)]
    rows = [print_stock(r, g, b) for b in steps for g in steps for r in steps]
    rows = [" ".join(f"{v:.6f}" for v in row) for row in rows]
    (HERE / "luts/print.cube").write_text(f"LUT_3D_SIZE {n}\n" + "\n".join(rows) + "\n")


def main():
    write_tables()
    config = ocio.Config.CreateFromFile(str(HERE / "studio.ocio"))
    config.validate()
    to_workshop = ocio.Config.GetProcessorFromBuiltinColorSpace("lin_rec709_scene", config, "scene_linear")
    lines = ["display,view,r,g,b,red,green,blue"]
    for display, view in VIEWS:
        shown = config.getProcessor(ocio.DisplayViewTransform(src="scene_linear", display=display, view=view))
        parts = [p.getDefaultCPUProcessor() for p in (to_workshop, shown)]
        for colour in COLOURS:
            codes = list(map(float, colour))
            for part in parts:
                codes = part.applyRGB(codes)
            lines.append(",".join([display, view, *map(str, colour), *(f"{v:.7f}" for v in codes)]))
    (HERE / "reference.csv").write_text("\n".join(lines) + "\n")


main()
