"""Found lights, set in the open scene, and taken back."""

import json
import math
import os
import tomllib

import bpy

from . import export, lamps, setter

SETTINGS = ("energy", "color", "use_temperature", "exposure", "size", "size_y", "shadow_soft_size", "angle",
            "use_soft_falloff")


def read(folder, lights):
    """What was written for the program, and what it found. Raises ValueError with one line."""
    try:
        with open(os.path.join(folder, export.LAMPS), encoding="utf-8") as file:
            record = json.load(file)
        with open(os.path.join(folder, export.SIDECAR), "rb") as file:
            sidecar = tomllib.load(file)
        with open(lights, "rb") as file:
            found = tomllib.load(file)
    except (OSError, ValueError) as error:
        raise ValueError(f"cannot read what was found: {error}") from error
    for what, path in ((sidecar, export.SIDECAR), (found, lights)):
        if what.get("schema") != 1:
            raise ValueError(f"{path}: its version is {what.get('schema')}, this add-on reads 1")
    return record, sidecar, found


def remember(scene, record):
    """Keeps the state of all that may be set, unless an earlier one is kept."""
    if setter.KEPT in scene:
        return
    before = {"lamps": {}, "values": {}, "emission": {}, "world": None, "added": [],
              "exposure": scene.view_settings.exposure}
    for entry in record["lights"].values():
        ob = bpy.data.objects.get(entry.get("object", ""))
        if ob is None or ob.type != "LIGHT":
            continue
        settings = {k: getattr(ob.data, k) for k in SETTINGS if hasattr(ob.data, k)}
        settings["color"] = list(ob.data.color)
        before["lamps"][ob.name] = {"settings": settings, "matrix": [list(r) for r in ob.matrix_basis],
                                    "hidden": ob.hide_render}
    if scene.world and (found := lamps.background_of(scene.world)):
        before["world"] = found[0].inputs["Strength"].default_value
    scene[setter.KEPT] = json.dumps(before)


def kept(scene):
    return json.loads(scene[setter.KEPT]) if setter.KEPT in scene else None


def set_light(light, area, entry, setting, authored):
    """Sets power, size and colour of a lamp that was there, in its own terms."""
    size = setting.get("size", 1.0)
    own = authored.get("size", 1.0)
    growth = size / own
    radiance = setting["radiance"]
    if authored["type"] == "disk" and light.type == "SUN":
        half = math.atan(math.tan(light.angle / 2.0) * growth)
        radiance *= math.pi * math.sin(half) ** 2
        light.angle = 2.0 * half
    color = setting.get("color")
    if color is not None:
        # Of luminance 1, so that its largest channel goes into the power.
        light.use_temperature = False
        most = max(color)
        light.color = [c / most for c in color]
    luminance = lamps.luminance(lamps.emitted(light))
    if radiance > 0.0 and luminance <= 0.0:
        light.use_temperature, light.color = False, (1.0, 1.0, 1.0)
        luminance = lamps.luminance(lamps.emitted(light))
    unit = entry["unit"] / (growth * growth if entry["normalize"] and area > 0.0 else 1.0)
    if light.type == "SUN":
        unit = lamps.unit_radiance(light, None)  # At its new angle.
    light.energy = radiance / (luminance * unit) if radiance > 0.0 else 0.0
    if growth != 1.0 and light.type == "AREA":
        light.size *= growth
        light.size_y *= growth
    elif growth != 1.0 and light.type in {"POINT", "SPOT"}:
        light.shadow_soft_size *= growth
    if getattr(light, "use_soft_falloff", False):
        light.use_soft_falloff = False


def restore(scene, before):
    """Sets lamps, world, values and exposure as they were before anything was applied."""
    from mathutils import Matrix

    for name in before["added"]:
        ob = bpy.data.objects.get(name)
        if ob is not None:
            data = ob.data
            bpy.data.objects.remove(ob)
            if data.users == 0:
                bpy.data.lights.remove(data)
    for name, was in before["lamps"].items():
        ob = bpy.data.objects.get(name)
        if ob is None:
            continue
        for key, value in was["settings"].items():
            setattr(ob.data, key, value)
        ob.matrix_basis = Matrix(was["matrix"])
        ob.hide_render = was["hidden"]
    surroundings = before.pop("surroundings", None)
    if surroundings:
        own, made = (bpy.data.worlds.get(surroundings[k]) for k in ("own", "name"))
        if scene.world == made:
            scene.world = own
        if own is not None:
            own.use_fake_user = surroundings["fake"]
        if made is not None and made.users == 0:
            bpy.data.worlds.remove(made)
    if before["world"] is not None and scene.world:
        found = lamps.background_of(scene.world)
        if found:
            found[0].inputs["Strength"].default_value = before["world"]
    for name, value in before["emission"].items():
        found = emission_of(bpy.data.materials.get(name))
        if found:
            found[1].default_value = value
    for name, value in before["values"].items():
        material = bpy.data.materials.get(name)
        if material is not None:
            setter.set_value(material, value)
    scene.view_settings.exposure = before["exposure"]


def apply(scene, folder, lights):
    """Sets the lights of a lights.toml; returns what is left to do by hand, one line each."""
    record, sidecar, found = read(folder, lights)
    remember(scene, record)
    before = kept(scene)
    restore(scene, before)
    before["added"] = []
    authored = {light["name"]: light for light in sidecar.get("lights", [])}
    by_hand, settings = [], {s["name"]: s for s in found.get("lights", [])}
    for name, setting in settings.items():
        entry = record["lights"].get(name, {})
        ob = bpy.data.objects.get(entry.get("object", ""))
        if setting.get("placed", {}).get("type") == "environment":
            surround(scene, setting, before)
        elif "placed" in setting:
            place(setting, ob, before)
        elif ob is not None and ob.type == "LIGHT":
            if ob.data.users > 1:
                ob.data = ob.data.copy()
            area = lamps.area_of(ob.data, ob.matrix_world)
            set_light(ob.data, area, entry, setting, authored[name])
        elif entry.get("world"):
            node = lamps.background_of(scene.world)
            if node is not None:
                own = node[0].inputs["Strength"]
                if entry["radiance"] > 0.0:
                    own.default_value *= setting["radiance"] / entry["radiance"]
        elif name not in authored:
            if not set_emission(name, setting, before):
                by_hand.append(f"{name}: set what it emits to {setting['radiance']:.4g}")
    if found.get("without_lights"):
        for entry in record["lights"].values():
            ob = bpy.data.objects.get(entry.get("object", ""))
            if ob is not None and ob.name not in before["added"]:
                ob.hide_render = True
            node = lamps.background_of(scene.world) if entry.get("world") and "surroundings" not in before else None
            if node is not None:
                node[0].inputs["Strength"].default_value = 0.0
    value = found.get("background", {}).get("value", 1.0)
    for name in record["background"]:
        material = bpy.data.materials.get(name)
        if material is None or not setter.set_value(material, value):
            by_hand.append(f"material {name}: multiply its colour by {value:.4g}")
        else:
            before["values"][name] = 1.0
    if "exposure" in found:
        scene.view_settings.exposure = math.log2(found["exposure"] / getattr(scene.cycles, "film_exposure", 1.0))
    scene[setter.KEPT] = json.dumps(before)
    return by_hand


def place(setting, ob, before):
    """Sets a lamp where the program put it; a new one is remembered, to be taken back."""
    color = setting.get("color") or setting["placed"].get("color") or [1.0, 1.0, 1.0]
    luminance = lamps.luminance(color)
    spec = lamps.placed_settings(setting["placed"], setting["radiance"], setting.get("size", 1.0),
                                 [c / luminance for c in color])
    if ob is not None and ob.type == "LIGHT" and ob.data.type == spec["type"]:
        spec["visible"] = ob.visible_camera
        spec["name"] = ob.name
        setter.set_lamp(spec)
        return
    if ob is not None and ob.type == "LIGHT":
        ob.hide_render = True  # One of another type stands in its place.
    spec["name"] = setting["name"]
    if spec["name"] in bpy.data.objects:
        spec["name"] += " (lightopt)"
    before["added"].append(setter.set_lamp(spec).name)


def surround(scene, setting, before):
    """Sets surroundings that the program chose, as a world of their own beside the scene's."""
    own, placed = scene.world, setting["placed"]
    before["surroundings"] = {"own": own.name if own else "", "name": ""}
    scene.world = bpy.data.worlds.new("lightopt surroundings")
    before["surroundings"]["name"] = scene.world.name
    if own is not None:
        own.use_fake_user, before["surroundings"]["fake"] = True, own.use_fake_user
    color = setting.get("color") or placed.get("color") or [1.0, 1.0, 1.0]
    luminance = lamps.luminance(color)
    setter.set_world({"strength": setting["radiance"], "color": [c / luminance for c in color],
                      "visible": own is None or own.cycles_visibility.camera, "image": placed["image"],
                      "turn": math.radians(90.0 - placed.get("rotation", 0.0))}, "")


def emission_of(material):
    """Colour and strength that a material emits by, or None where an image or nothing does."""
    inputs = {"BSDF_PRINCIPLED": ("Emission Color", "Emission Strength"), "EMISSION": ("Color", "Strength")}
    tree = material and material.node_tree
    for node in tree.nodes if tree else ():
        if node.type in inputs and not any(node.inputs[n].is_linked for n in inputs[node.type]):
            color, strength = (node.inputs[n] for n in inputs[node.type])
            if strength.default_value > 0.0 and max(list(color.default_value)[:3]) > 0.0:
                return color, strength
    return None


def set_emission(name, setting, before):
    """Sets the strength of a material that emits, whose radiance is that of its colour's luminance."""
    found = emission_of(bpy.data.materials.get(name))
    if found is None:
        return False
    color, strength = found
    before["emission"].setdefault(name, strength.default_value)
    # A strength of 0 would not be found again.
    strength.default_value = max(setting["radiance"], 1e-6) / lamps.luminance(list(color.default_value)[:3])
    return True


def back(scene):
    """Takes back what was applied; False where nothing was."""
    before = kept(scene)
    if before is None:
        return False
    restore(scene, before)
    del scene[setter.KEPT]
    return True


def choices(run):
    """The files of lights in a run's directory, the best first, with the names that a list shows."""
    names = sorted(n for n in os.listdir(run) if n.startswith("lights") and n.endswith(".toml")) if os.path.isdir(run) else []
    first = [n for n in names if n == "lights.toml"]
    others = [n for n in names if n != "lights.toml"]
    return [(n, "Best" if n == "lights.toml" else n.removeprefix("lights-").removesuffix(".toml")) for n in first + others]
