"""The surfaces of a scene as a glTF: evaluated, with instances, as they are rendered.

Everything that the render would show is copied into a scene of its own, whose objects' names say whether they
belong to the main object, and written by Blender's glTF exporter without lamps and cameras.
"""

from contextlib import contextmanager

import bpy

from . import materials

SURFACES = {"MESH", "CURVE", "SURFACE", "FONT", "META"}
# Types of objects that a render shows and a glTF does not.
WITHOUT_SURFACE = {"VOLUME": "volumes", "CURVES": "hair", "POINTCLOUD": "point clouds", "GPENCIL": "grease pencil",
                   "GREASEPENCIL": "grease pencil"}
MAIN, REST = "main", "rest"


def layers(layer):
    """A layer collection and all below it."""
    yield layer
    for child in layer.children:
        yield from layers(child)


@contextmanager
def as_rendered(context):
    """While it is open, the viewport shows modifiers as a render does, and what a render shows although the viewport
    hides it."""
    scene, kept = context.scene, []

    def put(owner, key, value):
        if getattr(owner, key) != value:
            kept.append((owner, key, getattr(owner, key)))
            setattr(owner, key, value)

    eyes = [ob for ob in context.view_layer.objects if ob.hide_get() and not ob.hide_render]
    try:
        for layer in layers(context.view_layer.layer_collection):
            if not layer.collection.hide_render:
                put(layer, "hide_viewport", False)
                put(layer.collection, "hide_viewport", False)
        for ob in eyes:
            ob.hide_set(False)
        for ob in scene.objects:
            if not ob.hide_render and not ob.library:
                put(ob, "hide_viewport", False)
            for m in ob.modifiers:
                put(m, "show_viewport", m.show_render)
                if m.type in {"SUBSURF", "MULTIRES"}:
                    put(m, "levels", m.render_levels)
        context.view_layer.update()
        yield
    finally:
        for owner, key, value in reversed(kept):
            setattr(owner, key, value)
        for ob in eyes:
            ob.hide_set(True)


def is_rendered(instance):
    """Whether a render shows an instance of the dependency graph."""
    ob = instance.object.original
    if instance.is_instance:
        parent = instance.parent and instance.parent.original
        return not ob.hide_render and not (parent and parent.hide_render)
    return not ob.hide_render and instance.show_self


def shown_collections(layer, hidden=False):
    """Objects that a view layer leaves out of a render, by collections hidden from it."""
    out = set()
    hidden = hidden or layer.collection.hide_render or layer.exclude
    if hidden:
        out.update(layer.collection.objects)
    for child in layer.children:
        out |= shown_collections(child, hidden)
    return out


def left_out(view_layer):
    """Objects that only hidden collections hold."""
    hidden = shown_collections(view_layer.layer_collection)
    held = set()

    def visit(layer, is_hidden):
        is_hidden = is_hidden or layer.collection.hide_render or layer.exclude
        if not is_hidden:
            held.update(layer.collection.objects)
        for child in layer.children:
            visit(child, is_hidden)

    visit(view_layer.layer_collection, False)
    return hidden - held


def copy_surfaces(depsgraph, target, is_main, hidden):
    """Fills the scene `target` with all surfaces; returns their materials by whether the main object has them, and
    what cannot be carried."""
    meshes, used, lost = {}, {MAIN: set(), REST: set()}, set()
    for instance in depsgraph.object_instances:
        ob = instance.object
        original = ob.original
        owner = instance.parent.original if instance.is_instance and instance.parent else original
        if not is_rendered(instance) or original in hidden or owner in hidden:
            continue
        if ob.type in WITHOUT_SURFACE:
            lost.add(f"{owner.name}: {WITHOUT_SURFACE[ob.type]}")
            continue
        if ob.type not in SURFACES:
            continue
        if any(p.settings.type == "HAIR" and p.settings.render_type == "PATH" for p in ob.particle_systems):
            lost.add(f"{owner.name}: hair")
        if not original.visible_camera:
            lost.add(f"{owner.name}: its ray visibility")
        part = MAIN if is_main(original) or is_main(owner) else REST
        # An instance of a mesh that modifiers did not make anew has the mesh of its data.
        name = (ob.data.name_full if ob.data else "", original.name_full, part)
        mesh = meshes.get(name)
        if mesh is None:
            mesh = bpy.data.meshes.new_from_object(ob, depsgraph=depsgraph)
            if mesh is None or not mesh.polygons:
                continue
            slots = [s.material.original if s.material else None for s in ob.material_slots]
            if slots and any(slots):
                mesh.materials.clear()
                for material in slots:
                    mesh.materials.append(material)
            meshes[name] = mesh
        used[part].update(m for m in mesh.materials if m is not None)
        copy = bpy.data.objects.new(f"{part}:{owner.name}", mesh)
        copy.matrix_world = instance.matrix_world.copy()
        target.collection.objects.link(copy)
    return used, sorted(lost)


def write(context, path, is_main):
    """Writes `path`, a .glb, of what the viewport shows; returns materials by part, the middle and the radius of the surfaces, and what
    cannot be carried. Raises ValueError without surfaces or a main object."""
    from mathutils import Vector

    before = set(bpy.data.meshes)
    target = bpy.data.scenes.new("lightopt export")
    window = context.window
    try:
        depsgraph = context.evaluated_depsgraph_get()
        used, lost = copy_surfaces(depsgraph, target, is_main, left_out(context.view_layer))
        objects = list(target.collection.objects)
        if not objects:
            raise ValueError("the scene has no surfaces that are rendered")
        if not any(o.name.startswith(f"{MAIN}:") for o in objects):
            raise ValueError("the main object has no surface that is rendered: select it, or choose its collection")
        corners = [o.matrix_world @ Vector(c) for o in objects for c in o.bound_box]
        low, high = (Vector(f(c[i] for c in corners) for i in range(3)) for f in (min, max))
        with materials.stand_ins(used[MAIN] | used[REST]):
            export(context, window, target, path)
        return used, ((low + high) / 2.0, max((high - low).length / 2.0, 1e-3)), lost
    finally:
        for ob in list(target.collection.objects):
            bpy.data.objects.remove(ob)
        bpy.data.scenes.remove(target)
        for mesh in set(bpy.data.meshes) - before:
            bpy.data.meshes.remove(mesh)


def export(context, window, target, path):
    """Writes a scene by Blender's exporter."""
    own = window.scene if window else None
    try:
        if window:
            window.scene = target
        with context.temp_override(scene=target, view_layer=target.view_layers[0]):
            target.view_layers[0].update()
            bpy.ops.export_scene.gltf(
                filepath=str(path), export_format="GLB", use_active_scene=True, export_lights=False,
                export_cameras=False, export_animations=False, export_skins=False, export_morph=False,
                export_apply=False, export_yup=True, export_extras=False)
    finally:
        if window:
            window.scene = own
