#!/usr/bin/env python3
"""Tries the add-on's operators without a window: messages, wishes, cancelling, choices, what is not carried.

    python3.11 -m venv target/blender && target/blender/bin/pip install -r tests/blender/requirements.txt
    cargo build --release && target/blender/bin/python tests/blender/operators.py

Every check prints a line; exit status 1 when one fails.
"""

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

HERE = Path(__file__).resolve().parent
ROOT = HERE.parent.parent
sys.path.insert(0, str(HERE))
import addon  # noqa: E402  (chooses a Blender that has never been used)
import bpy  # noqa: E402
import scenes  # noqa: E402

FAILED = []


def enable(program):
    """Enables the add-on, which an empty Blender forgets, and tells it its program."""
    name = "bl_ext.user_default.lightopt_embree"
    bpy.ops.preferences.addon_enable(module=name)
    bpy.context.preferences.addons[name].preferences.program = str(program)
    return sys.modules[name]


def check(name, fine, said=""):
    print(f"{name}: {'ok' if fine else 'FAILED'} {said}", flush=True)
    if not fine:
        FAILED.append(name)


def error_of(operator, **settings):
    """The line with which an operator fails."""
    try:
        operator(**settings)
    except RuntimeError as error:
        return str(error).strip()
    return ""


def messages(module, directory, program):
    """What is said when the program is not there, or another version."""
    find = module.program.find
    preferences = bpy.context.preferences.addons[module.__name__].preferences
    preferences.program = str(directory / "nowhere")
    check("a missing program is named", "no such program; set its path" in error_of(bpy.ops.lightopt.find))
    other = directory / "lightopt-embree"
    other.write_text("#!/bin/sh\necho lightopt-embree 9.8.7\n")
    other.chmod(0o755)
    preferences.program = str(other)
    check("another version is named", "version 9.8.7; this add-on needs 0.1" in error_of(bpy.ops.lightopt.find))
    preferences.program, path = "", os.environ["PATH"]
    os.environ["PATH"] = str(directory)
    check("PATH is searched", find() == str(other))
    os.environ["PATH"] = str(directory / "empty")
    beside = Path(module.program.HERE) / "bin"
    try:
        find()
        check("a lack is said", False)
    except ValueError as error:
        check("a lack is said", "unpack its archive" in str(error))
    beside.mkdir()
    (beside / "lightopt-embree").write_text(other.read_text())
    check("the program beside the add-on is taken", os.access(find(), os.X_OK) and find().startswith(str(beside)))
    os.environ["PATH"] = path
    preferences.program = str(program)


def lost(program):
    """What cannot be carried is listed."""
    scenes.empty("AgX")
    enable(program)
    scene = bpy.context.scene
    scene.view_settings.look = "AgX - Punchy"
    scenes.sweep(scenes.material("paper", (0.6, 0.6, 0.6), roughness=0.5))
    ball = scenes.add("uv_sphere", "ball", (0, 0, 0.5), scenes.material("clay", (0.7, 0.4, 0.3)), scale=0.5)
    scenes.add("cube", "pane", (-1, 1, 0.5), scenes.glass("window", (1, 1, 1), 0.0), size=0.4)
    scenes.lamp("POINT", "dot", (0, -2, 2), energy=10.0, shadow_soft_size=0.0)
    mixed = scenes.material("mixed", (0.5, 0.5, 0.5), roughness=0.5)
    tree = mixed.node_tree
    mix = tree.nodes.new("ShaderNodeMixShader")
    tree.links.new(mix.outputs[0], next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL").inputs["Surface"])
    scenes.add("cube", "box", (1, 1, 0.5), mixed, size=0.4)
    nodes = scenes.lamp("POINT", "noded", (1, -1, 2), energy=10.0)
    nodes.data.use_nodes = True
    nodes.data.node_tree.nodes.new("ShaderNodeTexIES")
    linked = scenes.lamp("AREA", "linked", (-1, -1, 2), energy=10.0, spread=1.0)
    linked.light_linking.receiver_collection = bpy.data.collections.new("only")
    portal = scenes.lamp("AREA", "portal", (0, -2, 2))
    portal.data.cycles.is_portal = True
    bpy.ops.object.volume_add()
    bpy.ops.mesh.primitive_plane_add(size=0.2, location=(0.5, 0, 0.1))
    bpy.ops.object.particle_system_add()
    bpy.context.object.particle_systems[0].settings.type = "HAIR"
    bpy.context.object.name = "tuft"
    scenes.camera((0.3, -5.0, 1.5), (0, 0, 0.8), (64, 48))
    scenes.select(ball)
    bpy.ops.lightopt.check()
    lines = [line.text for line in scene.lightopt.lost]
    for words in ("noded: its IES profile", "linked: light linking", "linked: its spread", "portal: a portal",
                  "tuft: hair", "volumes", "material mixed: its shader (Mix Shader)", "dot: without a size Cycles shows", "look AgX - Punchy"):
        check(f"listed: {words}", any(words in line for line in lines))
    sidecar = (Path(scene.lightopt.folder_path()) / "scene.toml").read_text()
    check("a portal is left out", 'name = "portal"' not in sidecar and 'name = "linked"' in sidecar)
    print("  " + "\n  ".join(lines))


def wishes(program, directory):
    """Locks and ratios are words of the command, and a run can be cancelled."""
    scenes.studio()
    module = enable(program)
    scene = bpy.context.scene
    s = scene.lightopt
    s.main = bpy.data.collections["subject"]
    s.folder, s.more = str(directory / "wishes"), "--final-spp 100000 --final-noise 0 --size 640x480"
    bpy.data.objects["Key"].lightopt.lock = True
    other = bpy.data.objects["Lämpchen.001"].lightopt
    other.leader, other.stops = bpy.data.objects["Key"], -2.0
    s.size = False
    bpy.ops.lightopt.find()
    run = module.operators.RUN["run"]
    words = run.process.args
    check("a lock", words[words.index("--lock") + 1] == "Key")
    check("a ratio", words[words.index("--ratio") + 1] == "L_mpchen.001=Key*0.25")
    check("what may vary", words[words.index("--free") + 1] == "radiance,background")
    found = Path(s.folder) / "run/lights.toml"
    end = time.time() + 300
    while not found.is_file() and time.time() < end and not run.is_done():
        time.sleep(0.5)
    begun = time.time()
    bpy.ops.lightopt.cancel()
    status = run.wait(30)
    module.operators.tick()
    check("cancelled in order", status == 130 and module.operators.RUN["run"] is None,
          f"after {time.time() - begun:.1f} s: {s.said}")
    import tomllib

    bpy.ops.ed.undo_push(message="before")
    bpy.ops.lightopt.apply("EXEC_DEFAULT", True)
    bpy.ops.ed.undo()
    scene = bpy.context.scene
    check("undone in one step", abs(bpy.data.objects["Lämpchen.001"].data.energy - 40.0) < 1e-6
          and module.setter.KEPT not in scene)
    s = scene.lightopt
    before = bpy.data.objects["Key"].data.energy
    own = bpy.data.objects["Lämpchen.001"].data.energy
    bpy.ops.lightopt.apply()
    check("a locked lamp stays", abs(bpy.data.objects["Key"].data.energy / before - 1) < 1e-4)
    # Another choice, as a contact sheet offers.
    text = found.read_text()
    lights = tomllib.loads(text)
    more = text.replace(f'radiance = {lights["lights"][1]["radiance"]}', "radiance = 1.0")
    found.with_name("lights-02.toml").write_text(more)
    check("choices", [n for n, _ in module.results.choices(str(found.parent))] == ["lights.toml", "lights-02.toml"])
    bpy.ops.lightopt.apply(lights="lights-02.toml")
    energy = bpy.data.objects["Lämpchen.001"].data.energy
    import math

    # A sphere of radius 0.15 and radiance 1.
    check("another choice is applied", abs(energy / (4 * math.pi**2 * 0.15**2) - 1) < 1e-4, f"{energy:.5f}")
    bpy.ops.lightopt.back()
    check("back", abs(bpy.data.objects["Lämpchen.001"].data.energy / own - 1) < 1e-6
          and bpy.data.objects["Lämpchen.001"].data.use_soft_falloff)
    color = bpy.data.materials["paper"].node_tree.nodes["Diffuse BSDF"].inputs[0].default_value[0]
    check("back: colours", abs(color - 0.6) < 1e-6)
    panels(module, directory)


class Layout:
    """Takes whatever a panel draws, and remembers the operators and properties."""

    def __init__(self):
        self.drawn = []

    def __getattr__(self, name):
        def draw(*args, **_):
            self.drawn.append((name, *(a for a in args if isinstance(a, str))))
            for owner, prop in zip(args, args[1:]):
                if name == "prop":
                    owner.bl_rna.properties[prop]
            return self

        return draw

    def __setattr__(self, name, value):
        self.__dict__[name] = value


def panels(module, directory):
    """Panels draw what there is, by properties and operators that exist."""
    context, drawn = bpy.context, []
    bpy.data.images.new("sheet", 16, 8).save(filepath=str(directory / "wishes/run/contact.png"))
    for cls in module.panel.CLASSES:
        layout = Layout()
        me = type("Drawn", (), {"layout": layout, "found": lambda self, s, l: cls.found(self, s, l)})()
        cls.draw(me, context)
        drawn += layout.drawn
    # Without a window there are no icons, so that the contact sheet itself cannot show.
    names = {d[1] for d in drawn if d[0] == "operator"}
    check("panels draw", {"lightopt.find", "lightopt.apply", "lightopt.back", "lightopt.open"} <= names)


def refusals(program):
    """What is wrong is one line."""
    scenes.studio()
    enable(program)
    scenes.select()
    check("no main object", "the main object has no surface" in error_of(bpy.ops.lightopt.check))
    bpy.context.scene.camera = None
    check("no camera", "the scene has no camera" in error_of(bpy.ops.lightopt.check))
    scene = bpy.context.scene
    scene.view_settings.view_transform = "False Color"
    bpy.ops.lightopt.known_view()
    check("Standard", scene.view_settings.view_transform == "Standard")
    view = scene.view_settings
    view.view_transform, view.look = "AgX", "AgX - Punchy"
    bpy.ops.lightopt.known_view()
    check("a view that is known is kept", (view.view_transform, view.look) == ("AgX", "None"))
    view.view_transform = "Standard"


def main():
    parser = argparse.ArgumentParser()
    parser.add_argument("--program", default=str(ROOT / "target/release/lightopt-embree"))
    args = parser.parse_args()
    directory = Path(tempfile.mkdtemp())
    bpy.ops.wm.read_factory_settings(use_empty=True)
    name = addon.install(directory)
    module = sys.modules[name]
    messages(module, directory, args.program)
    lost(args.program)
    refusals(args.program)
    wishes(args.program, directory)
    bpy.ops.preferences.addon_disable(module=name)
    check("the add-on can be disabled", not hasattr(bpy.types.Scene, "lightopt"))
    sys.exit(bool(FAILED))


if __name__ == "__main__":
    main()
