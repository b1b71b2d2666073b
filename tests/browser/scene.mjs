// Scenes for the tests of the page: a room with a box, and lights around it.

import { writeFileSync } from "node:fs";
import { join } from "node:path";

const OBJ = `mtllib room.mtl
v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv -1 2 -1\nv 1 2 -1
v -.3 0 -.3\nv .3 0 -.3\nv .3 0 .3\nv -.3 0 .3
v -.3 .6 -.3\nv .3 .6 -.3\nv .3 .6 .3\nv -.3 .6 .3
o floor\nusemtl floor\nf 4 3 2 1
o wall\nusemtl wall\nf 1 2 6 5
o box\nusemtl red
f 14 13 12 11\nf 10 9 13 14\nf 8 7 11 12\nf 7 10 14 11\nf 9 8 12 13
`;
const MTL = "newmtl floor\nKd 0.5 0.5 0.5\nnewmtl wall\nKd 0.6 0.6 0.7\nnewmtl red\nKd 0.7 0.2 0.1\n";

// Writes a scene with `n` lights, every third of them a sphere, in colours of their own.
export function writeScene(directory, name, n) {
  const lights = Array.from({ length: n }, (_, i) => {
    const angle = (2 * Math.PI * i) / n, at = [Math.cos(angle) * 0.8, 1.3 + 0.4 * Math.sin(2 * angle), 0.5 + 0.5 * Math.sin(angle)];
    const place = `position = [${at.map((v) => v.toFixed(3)).join(", ")}]`;
    const colour = `color = [1.0, ${(0.8 + 0.02 * i).toFixed(2)}, ${(1.0 - 0.05 * i).toFixed(2)}]`;
    const shape = i % 3 === 2 ? `type = "sphere"\n${place}\nradius = 0.05` : `type = "rectangle"\n${place}\nlook_at = [0.0, 0.3, 0.0]\nhalf_extents = [0.1, 0.08]`;
    return `[[lights]]\nname = "light ${i + 1}"\n${shape}\nradiance = ${(12 / n + 0.3 * i).toFixed(2)}\n${colour}\n`;
  });
  const sidecar = `schema = 1
[camera]
position = [0.0, 1.0, 3.0]
look_at = [0.0, 0.5, 0.0]
vfov = 45.0
size = [96, 72]
[main_object]
objects = ["box"]
[background]
materials = ["wall", "floor"]
${lights.join("")}`;
  writeFileSync(join(directory, `${name}.obj`), OBJ);
  writeFileSync(join(directory, "room.mtl"), MTL);
  writeFileSync(join(directory, `${name}.toml`), sidecar);
  return join(directory, `${name}.obj`);
}
