"""The open scene, written for the program: scene.glb, scene.toml, and lamps.json, by which results come back."""

import json
import os

import bpy

from . import geometry, lamps, materials, setter, sidecar

SCENE, SIDECAR, LAMPS = "scene.glb", "scene.toml", "lamps.json"


def ascii_name(name, taken):
    """A name that a sidecar takes and nothing else has."""
    plain = "".join(c if c.isascii() and c.isprintable() and c != "=" else "_" for c in name)[:180] or "lamp"
    found, n = plain, 1
    while found in taken:
        n += 1
        found = f"{plain}_{n}"
    taken.add(found)
    return found


def main_objects(context, collection=None):
    """The main object: the objects of a collection, or what is selected and shows a surface; with what hangs on it."""
    chosen = set(collection.all_objects) if collection else set(context.selected_objects)
    for ob in list(chosen):
        chosen.update(ob.children_recursive)
    return {ob for ob in chosen if ob.type in geometry.SURFACES | {"EMPTY"}}


def lights(context, hidden, extent):
    """Lamps of the sidecar, by name their objects, ties between instances, and what is not carried."""
    tables, found, ties, lost, taken, first = [], {}, [], [], set(), {}
    for instance in context.evaluated_depsgraph_get().object_instances:
        ob = instance.object
        original = ob.original
        owner = instance.parent.original if instance.is_instance and instance.parent else original
        if ob.type != "LIGHT" or not geometry.is_rendered(instance) or original in hidden or owner in hidden:
            continue
        if getattr(ob.data.cycles, "is_portal", False):
            lost.append(f"{original.name}: a portal, left out")
            continue
        name = ascii_name(original.name, taken)
        table, gone = lamps.of_lamp(ob, instance.matrix_world, name, extent[1], extent[0])
        tables.append(table)
        if original not in first:
            first[original] = table
            lost += [f"{original.name}: {words}" for words in gone]
            found[name] = {"object": original.name, "radiance": table["radiance"],
                           "unit": lamps.unit_radiance(ob.data, instance.matrix_world),
                           "normalize": lamps.is_normalized(ob.data)}
            continue
        # One lamp in many places has one power, and its size and place stay.
        ties.append(f"{name}={first[original]['name']}*1")
        for one in (table, first[original]):
            one["movable"] = False
            if "half_extents" in one or one.get("radius"):
                one["size_range"] = [1.0, 1.0]
    return tables, found, ties, lost


def write(context, folder, collection=None):
    """Writes the scene into a folder; returns what cannot be carried, one line each.

    Raises ValueError with one line where there is nothing to light."""
    os.makedirs(folder, exist_ok=True)
    scene = context.scene
    setter.adopt(scene)
    main = main_objects(context, collection)
    camera, lost = lamps.of_camera(scene)
    with geometry.as_rendered(context):
        used, extent, gone = geometry.write(context, os.path.join(folder, SCENE), main.__contains__)
        lost += gone
        tables, found, ties, gone = lights(context, geometry.left_out(context.view_layer), extent)
    lost += gone
    world, gone = lamps.of_world(scene.world, folder, ascii_name("World", {t["name"] for t in tables}))
    lost += gone
    if world:
        tables.append(world)
        found[world["name"]] = {"world": True, "radiance": world["radiance"]}
    top, gone = lamps.of_view(scene)
    lost += gone
    described = {}
    for material in sorted(used[geometry.MAIN] | used[geometry.REST], key=lambda m: m.name):
        table, gone = materials.described(material)
        lost += [f"material {material.name}: {words}" for words in gone]
        if table:
            described[material.name] = table
    if any(materials.is_smooth(m) for m in used[geometry.MAIN] | used[geometry.REST]):
        lost += [f"{table['name']}: without a size Cycles shows none of its light through smooth glass and off mirrors; "
                 "the program does" for table in tables if lamps.is_without_size(table)]
    background = sorted(m.name for m in used[geometry.REST] - used[geometry.MAIN] if materials.has_value(m))
    text = sidecar.text(top, camera, {"objects": [f"{geometry.MAIN}:*"]},
                        {"materials": background} if background else None, tables, described,
                        {"tie": ties} if ties else None)
    with open(os.path.join(folder, SIDECAR), "w", encoding="utf-8") as out:
        out.write(text)
    record = {"schema": 1, "blend": bpy.data.filepath, "scene": scene.name, "lights": found, "background": background}
    with open(os.path.join(folder, LAMPS), "w", encoding="utf-8") as out:
        json.dump(record, out, indent=1, sort_keys=True)
    return lost
