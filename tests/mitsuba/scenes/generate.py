#!/usr/bin/env python3
"""Writes the scenes of the comparison beside itself: OBJ, MTL, sidecar and pictures.

Needs nothing but Python. Run it again after a change and commit what it writes.
"""

import math
import struct
import zlib
from pathlib import Path

HERE = Path(__file__).resolve().parent

CAMERA = """[camera]
position = [0.0, 1.0, 3.8]
look_at = [0.0, 0.95, 0.0]
vfov = 38.0
size = [64, 48]
"""

MATERIALS = {
    "white": "Kd 0.7 0.7 0.7\nillum 1",
    "red": "Kd 0.6 0.1 0.1\nillum 1",
    "green": "Kd 0.1 0.5 0.1\nillum 1",
    "blue": "Kd 0.2 0.3 0.7\nillum 1",
    "rough_plastic": "Kd 0.5 0.35 0.2\nKs 0.04 0.04 0.04\nNi 1.5\nPr 0.35\nillum 2",
    "smooth_plastic": "Kd 0.3 0.5 0.8\nKs 0.04 0.04 0.04\nNi 1.5\nPr 0\nillum 2",
    "rough_metal": "Kd 0.9 0.6 0.3\nPm 1\nPr 0.45\nillum 2",
    "mirror": "Kd 1 1 1\nPm 1\nPr 0\nillum 2",
    "glass": "Ni 1.5\nPr 0\nillum 7",
    "rough_glass": "Ni 1.5\nPr 0.5\nillum 7",
    "lamp": "Kd 0.4 0.4 0.4\nKe 5 4 2.5\nillum 1",
    "bulb": "Kd 0.3 0.3 0.5\nKe 2 3 5\nillum 1",
    "waves": "Kd 0.6 0.5 0.4\nKs 0.04 0.04 0.04\nNi 1.5\nPr 0.4\nnorm waves.png\nillum 2",
    "dents": "Kd 0.4 0.6 0.7\nmap_Bump -bm 15 -s 2 3 1 -o 0.1 0.2 0 dents.png\nillum 1",
    "veil": "Kd 0.7 0.3 0.2\nd 0.5\nillum 1",
    "leaf": "Kd 0.2 0.6 0.2\nmap_d dents.png\nKs 0.04 0.04 0.04\nNi 1.5\nPr 0.4\nillum 2",
    "half_metal": "Kd 0.9 0.6 0.3\nKs 0.04 0.04 0.04\nNi 1.5\nPm 0.5\nPr 0.4\nillum 2",
    "rusty": "Kd 0.8 0.5 0.3\nmap_Pm dents.png\nPr 0.5\nillum 1",
    "worn": "Kd 0.8 0.8 0.7\nPm 1\nmap_Pr dents.png\nillum 2",
    "checks": "Kd 0.9 0.8 1.0\nmap_Kd textured.png\nillum 1",
}


class Obj:
    """A Wavefront OBJ under construction."""

    def __init__(self):
        self.lines = []
        self.n = 0
        self.materials = []

    def group(self, name, material):
        self.lines += [f"o {name}", f"usemtl {material}"]
        if material not in self.materials:
            self.materials.append(material)

    def vertex(self, p, n, uv=(0.0, 0.0)):
        self.lines.append("v " + " ".join(f"{x:.6g}" for x in p))
        self.lines.append("vn " + " ".join(f"{x:.6g}" for x in n))
        self.lines.append("vt " + " ".join(f"{x:.6g}" for x in uv))
        self.n += 1
        return self.n

    def face(self, ids):
        self.lines.append("f " + " ".join(f"{i}/{i}/{i}" for i in ids))

    def quad(self, p, a, b, repeat=(1.0, 1.0)):
        """The parallelogram p + u a + v b, its front along a x b."""
        n = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        length = math.sqrt(sum(x * x for x in n))
        n = [x / length for x in n]
        corners = [(0, 0), (1, 0), (1, 1), (0, 1)]
        self.face([self.vertex([p[i] + u * a[i] + v * b[i] for i in range(3)], n,
                               (u * repeat[0], v * repeat[1])) for u, v in corners])

    def grid(self, rows, columns, point):
        """point(i, j) -> (position, normal), closed along j where it repeats."""
        ids = [[self.vertex(*point(i, j)) for j in range(columns + 1)] for i in range(rows + 1)]
        for i in range(rows):
            for j in range(columns):
                self.face([ids[i][j], ids[i][j + 1], ids[i + 1][j + 1], ids[i + 1][j]])

    def sphere(self, center, radius, n):
        def point(i, j):
            theta, phi = math.pi * i / n, math.pi * j / n
            d = (math.sin(theta) * math.cos(phi), math.cos(theta), math.sin(theta) * math.sin(phi))
            return [c + radius * x for c, x in zip(center, d)], d
        self.grid(n, 2 * n, point)

    def box(self, lo, hi):
        d = [h - l for l, h in zip(lo, hi)]
        x, y, z = [d[0], 0, 0], [0, d[1], 0], [0, 0, d[2]]
        def minus(v):
            return [-a for a in v]
        for p, a, b in [(lo, y, x), (lo, x, z), (lo, z, y), (hi, minus(x), minus(y)),
                        (hi, minus(z), minus(x)), (hi, minus(y), minus(z))]:
            self.quad(p, a, b)

    def room(self, floor="white"):
        """A box of 2 m open toward +z."""
        self.group("floor", floor)
        self.quad([-1, 0, -1], [0, 0, 2], [2, 0, 0], (2.5, 2.0))
        self.group("walls", "white")
        self.quad([-1, 2, -1], [2, 0, 0], [0, 0, 2])
        self.quad([-1, 0, -1], [2, 0, 0], [0, 2, 0])
        self.group("left", "red")
        self.quad([-1, 0, -1], [0, 2, 0], [0, 0, 2])
        self.group("right", "green")
        self.quad([1, 0, -1], [0, 0, 2], [0, 2, 0])

    def write(self, name, main, lights, camera=CAMERA):
        (HERE / f"{name}.obj").write_text("\n".join([f"mtllib {name}.mtl", *self.lines]) + "\n")
        mtl = "\n\n".join(f"newmtl {m}\n{MATERIALS[m]}" for m in self.materials)
        (HERE / f"{name}.mtl").write_text(mtl + "\n")
        text = f'schema = 1\n\n{camera}\n[main_object]\nobjects = ["{main}"]\n'
        for light in lights:
            text += "\n[[lights]]\n" + "".join(f"{k} = {v}\n" for k, v in light.items())
        (HERE / f"{name}.toml").write_text(text)


def ceiling(**other):
    return {"name": '"ceiling"', "type": '"rectangle"', "position": [0.0, 1.98, 0.0],
            "look_at": [0.0, 0.0, 0.0], "up": [0.0, 0.0, 1.0], "half_extents": [0.4, 0.3],
            "radiance": 6.0, **other}


def ball(name, material, n=16, radius=0.5, floor="white", lights=None):
    o = Obj()
    o.room(floor)
    o.group("ball", material)
    o.sphere([0.0, radius + 0.1, 0.1], radius, n)
    o.write(name, "ball", lights or [ceiling()])


def ring(o, center, radius, height, n):
    """An open cylinder with smooth normals, seen and reflecting on both sides."""
    def point(i, j):
        phi = 2.0 * math.pi * j / n
        d = (math.cos(phi), 0.0, math.sin(phi))
        return [center[0] + radius * d[0], center[1] + height * i, center[2] + radius * d[2]], d
    o.grid(1, n, point)


def png(path, width, height, pixel):
    raw = b"".join(b"\0" + bytes(c for x in range(width) for c in pixel(x, y)) for y in range(height))
    def chunk(kind, data):
        body = kind + data
        return struct.pack(">I", len(data)) + body + struct.pack(">I", zlib.crc32(body))
    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(raw, 9))
                     + chunk(b"IEND", b""))


def hdr(path, width, height, pixel):
    """Radiance RGBE, not compressed."""
    def rgbe(rgb):
        exponent = max(math.frexp(max(rgb))[1], -127)
        return bytes(min(int(c * 2.0 ** (8 - exponent)), 255) for c in rgb) + bytes([exponent + 128])
    header = f"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y {height} +X {width}\n"
    path.write_bytes(header.encode() + b"".join(rgbe(pixel(x, y)) for y in range(height) for x in range(width)))


def ground(o, material="white"):
    o.group("ground", material)
    o.quad([-2, 0, -2], [0, 0, 4], [4, 0, 0])


def main():
    o = Obj()
    o.room()
    o.group("boxes", "white")
    o.box([-0.7, 0.0, -0.6], [-0.1, 1.1, 0.0])
    o.box([0.1, 0.0, -0.1], [0.6, 0.5, 0.4])
    o.write("cornell", "boxes", [ceiling(color=[1.0, 0.8, 0.5])])

    o = Obj()
    o.room("rough_plastic")
    o.group("boxes", "blue")
    o.box([-0.6, 0.0, -0.6], [-0.1, 0.9, -0.1])
    lamp = {"name": '"lamp"', "type": '"disk"', "position": [0.3, 1.5, -0.6], "look_at": [0.0, 0.0, 0.0],
            "radius": 0.3, "size": 0.8, "radiance": 14.0}
    o.write("glossy_floor", "boxes", [lamp])

    ball("smooth_plastic", "smooth_plastic")
    bulb = {"name": '"bulb"', "type": '"sphere"', "position": [-0.4, 1.5, 0.3], "radius": 0.2,
            "size": 0.9, "radiance": 9.0, "color": [0.9, 1.0, 0.8]}
    ball("rough_conductor", "rough_metal", lights=[bulb])
    ball("smooth_normals", "white", n=5, radius=0.6)
    ball("smooth_glass", "glass")
    ball("rough_glass", "rough_glass")
    point = {"name": '"point"', "type": '"point"', "position": [0.3, 1.7, 0.5], "radiance": 2.5,
             "color": [1.0, 0.9, 0.7]}
    ball("point_light", "rough_plastic", lights=[point])

    o = Obj()
    o.room()
    o.group("ring", "mirror")
    ring(o, [0.0, 0.0, 0.2], 0.5, 0.35, 64)
    small = {"name": '"small"', "type": '"disk"', "position": [0.7, 1.4, 0.5], "look_at": [0.0, 0.1, 0.2],
             "radius": 0.25, "radiance": 14.0}
    o.write("caustic", "ring", [small])

    # A light before a light before a light: all are counted along a ray, and none shades the others.
    o = Obj()
    o.room()
    o.group("boxes", "rough_metal")
    o.box([-0.8, 0.0, -0.8], [-0.3, 0.6, -0.3])
    lights = [
        {"name": '"near"', "type": '"rectangle"', "position": [0.0, 1.2, 0.6], "look_at": [0.0, 1.2, 2.0],
         "half_extents": [0.3, 0.2], "radiance": 1.0, "color": [1.0, 0.3, 0.3]},
        {"name": '"far"', "type": '"sphere"', "position": [0.0, 1.2, -0.2], "radius": 0.3,
         "radiance": 1.5, "color": [0.3, 1.0, 0.3]},
        {"name": '"top"', "type": '"disk"', "position": [0.0, 1.9, -0.2], "look_at": [0.0, 0.0, -0.2],
         "radius": 0.4, "radiance": 3.0, "color": [0.4, 0.4, 1.0]},
    ]
    o.write("lights_in_line", "boxes", lights)

    def texel(x, y):
        dark = (x + y) % 2
        return (40 + 12 * x if dark else 250, 230 - 20 * y if dark else 200, 60 + 100 * dark + 8 * x)
    png(HERE / "textured.png", 8, 6, texel)
    o = Obj()
    o.room("checks")
    o.group("boxes", "white")
    o.box([-0.5, 0.0, -0.6], [0.0, 0.7, -0.1])
    o.write("textured", "boxes", [ceiling()])

    def sky(x, y):
        if y >= 4:
            return (0.25 + 0.02 * (x % 3), 0.2, 0.12)
        window = (6.0, 5.0, 4.0) if 3 <= x <= 4 and y in (1, 2) else (0.0, 0.0, 0.0)
        return tuple(w + c for w, c in zip(window, (0.2 + 0.04 * x, 0.5, 0.9 - 0.1 * y)))
    hdr(HERE / "sky.hdr", 16, 8, sky)
    o = Obj()
    ground(o)
    o.group("box", "blue")
    o.box([-0.9, 0.0, -0.3], [-0.3, 0.8, 0.3])
    o.group("ball", "rough_plastic")
    o.sphere([0.45, 0.5, 0.2], 0.5, 12)
    sky_light = {"name": '"sky"', "type": '"environment"', "image": '"sky.hdr"', "rotation": 40.0,
                 "radiance": 0.8, "color": [1.0, 0.95, 0.9]}
    o.write("environment", "ball", [sky_light])

    o = Obj()
    ground(o)
    o.group("boxes", "white")
    o.box([-0.9, 0.0, -0.6], [-0.3, 1.2, 0.0])
    o.group("roof", "red")
    o.box([0.0, 0.6, -0.6], [0.9, 0.7, 0.4])
    cloud = {"name": '"cloud"', "type": '"environment"', "radiance": 1.2, "color": [0.9, 1.0, 1.1]}
    o.write("overcast", "boxes", [cloud])

    o = Obj()
    o.room()
    o.group("boxes", "rough_plastic")
    o.box([-0.5, 0.0, -0.6], [0.0, 0.7, -0.1])
    lights = [
        {"name": '"disk"', "type": '"spot"', "position": [0.5, 1.8, 0.4], "look_at": [-0.3, 0.2, -0.3],
         "radius": 0.15, "angle": 35.0, "softness": 0.5, "radiance": 40.0, "color": [1.0, 0.8, 0.6]},
        {"name": '"point"', "type": '"spot"', "position": [-0.6, 1.6, 0.6], "look_at": [0.6, 0.3, -0.5],
         "radius": 0.0, "angle": 25.0, "softness": 0.3, "radiance": 2.0, "color": [0.5, 0.8, 1.0]},
    ]
    o.write("spot", "boxes", lights)

    o = Obj()
    o.room("rough_plastic")
    o.group("boxes", "white")
    o.box([-0.5, 0.0, -0.6], [0.0, 0.7, -0.1])
    sun = {"name": '"sun"', "type": '"distant"', "position": [1.0, 1.5, 3.0], "look_at": [0.0, 0.0, 0.0],
           "radiance": 3.0, "color": [1.0, 0.9, 0.7]}
    o.write("sun", "boxes", [sun])

    # Emitters that are surfaces: a flat one, one with smooth normals, and a body that stops light.
    o = Obj()
    o.room()
    o.group("lamp", "lamp")
    o.box([-0.7, 1.2, -0.6], [-0.4, 1.4, -0.3])
    o.group("bulb", "bulb")
    o.sphere([0.5, 0.3, 0.2], 0.2, 5)
    shade = {"name": '"shade"', "type": '"disk"', "position": [0.2, 1.2, -0.2], "look_at": [0.0, 0.0, 0.0],
             "radius": 0.3, "radiance": 4.0, "occludes": "true"}
    o.write("shining_mesh", "bulb", [shade])

    o = Obj()
    o.room()
    o.group("boxes", "white")
    o.box([-0.7, 0.0, -0.6], [-0.1, 1.1, 0.0])
    o.box([0.1, 0.0, -0.1], [0.6, 0.5, 0.4])
    o.write("thin_lens", "boxes", [ceiling()],
            CAMERA.rstrip() + "\naperture_radius = 0.08\nfocus_distance = 3.5\n")

    # One period of waves as normals, and of dents as numbers.
    def waves(x, y):
        tilt = (0.5 * math.sin(2 * math.pi * (x + 0.5) / 16), 0.4 * math.cos(4 * math.pi * (y + 0.5) / 16))
        length = math.sqrt(1 + tilt[0] ** 2 + tilt[1] ** 2)
        return tuple(round(127.5 * (c / length + 1)) for c in (*tilt, 1.0))
    png(HERE / "waves.png", 16, 16, waves)
    def dents(x, y):
        d = math.hypot(x - 7.5, y - 6.5) / 6
        return (round(40 + 200 * max(0.0, 1 - d * d)),) * 3
    png(HERE / "dents.png", 16, 16, dents)

    o = Obj()
    o.room("waves")
    o.group("panel", "dents")
    o.quad([-0.8, 0.2, -0.6], [1.0, 0, 0.4], [0, 1.0, 0])
    o.group("turned", "waves")
    o.quad([0.7, 0.2, -0.2], [0, 0.8, 0], [-0.5, 0, 0.3])
    o.write("normal_mapped", "panel", [ceiling()])

    o = Obj()
    o.room()
    o.group("veil", "veil")
    o.quad([-0.8, 0.2, -0.2], [0.8, 0, 0.3], [0, 1.2, 0])
    o.group("leaf", "leaf")
    o.quad([0.1, 0.7, 0.3], [0.7, 0, 0], [0, 0.2, -0.9])
    o.write("cutout", "veil", [ceiling()])

    o = Obj()
    o.room("rusty")
    o.group("ball", "half_metal")
    o.sphere([-0.45, 0.4, 0.1], 0.4, 8)
    o.group("panel", "worn")
    o.quad([0.1, 0.1, -0.4], [0.7, 0, 0.3], [0, 1.0, 0])
    o.write("metallic_blend", "ball", [ceiling()])


if __name__ == "__main__":
    main()
