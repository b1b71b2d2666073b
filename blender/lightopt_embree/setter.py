"""Sets what a lighting decides in the scene that is open in Blender: lamps, world, background, view.

Everything is found by name and made where it is not there; doing it twice changes nothing more.
"""

import os

import bpy
from mathutils import Matrix

# Custom property of a scene: its state before something was set, by which the add-on takes it back.
KEPT = "lightopt_before"
# Custom properties of a material: its own base colour, and that which was set.
OWN_COLOR, SET_COLOR = "lightopt_own_color", "lightopt_set_color"
# Name of the nodes that multiply an image by the background's value.
VALUE_NODE = "lightopt value"
# Shaders whose colour the background's value scales, with the name of its input.
COLORED = {
    "BSDF_PRINCIPLED": "Base Color",
    "BSDF_DIFFUSE": "Color",
    "BSDF_GLOSSY": "Color",
    "BSDF_METALLIC": "Base Color",
}


def set_lamp(spec):
    """Sets the lamp of this name, or makes it; returns its object."""
    ob = bpy.data.objects.get(spec["name"])
    if ob is None or ob.type != "LIGHT":
        data = bpy.data.lights.new(spec["name"], spec["type"])
        ob = bpy.data.objects.new(spec["name"], data)
        bpy.context.scene.collection.objects.link(ob)
    elif ob.data.users > 1:
        ob.data = ob.data.copy()
    ob.data.type = spec["type"]
    light = bpy.data.lights[ob.data.name]  # Its class is that of its type, asked anew.
    if light.node_tree is not None and light.use_nodes:
        light.use_nodes = False
    plain = {"use_temperature": False, "exposure": 0.0, "normalize": True, "spread": 3.141592653589793}
    for key, value in {**plain, **spec["settings"]}.items():
        if hasattr(light, key):
            setattr(light, key, value)
    ob.matrix_world = Matrix(spec["matrix"])
    ob.visible_camera = spec["visible"]
    ob.hide_render = False
    return ob


def set_world(spec, folder):
    """Sets the world: a colour, or a picture in a folder, turned about the vertical."""
    scene = bpy.context.scene
    if scene.world is None:
        scene.world = bpy.data.worlds.new("World")
    world = scene.world
    if not getattr(world, "use_nodes", True):
        world.use_nodes = True
    tree = world.node_tree
    tree.nodes.clear()
    out = tree.nodes.new("ShaderNodeOutputWorld")
    shader = tree.nodes.new("ShaderNodeBackground")
    tree.links.new(shader.outputs[0], out.inputs["Surface"])
    shader.inputs["Strength"].default_value = 0.0 if spec is None else spec["strength"]
    if spec is None:
        return
    shader.inputs["Color"].default_value = (*spec["color"], 1.0)
    world.cycles_visibility.camera = spec["visible"]
    if spec["image"] is None:
        return
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    mapping = tree.nodes.new("ShaderNodeMapping")
    picture = tree.nodes.new("ShaderNodeTexEnvironment")
    picture.image = bpy.data.images.load(os.path.join(folder, spec["image"]), check_existing=True)
    picture.image.colorspace_settings.name = "Linear Rec.709"
    mapping.inputs["Rotation"].default_value[2] = spec["turn"]
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], picture.inputs["Vector"])
    tint = tree.nodes.new("ShaderNodeMix")
    tint.data_type, tint.blend_type = "RGBA", "MULTIPLY"
    tint.inputs["Factor"].default_value = 1.0
    # Sockets of a Mix node share their names between its types.
    a, b = [s for s in tint.inputs if s.type == "RGBA"]
    b.default_value = (*spec["color"], 1.0)
    tree.links.new(picture.outputs["Color"], a)
    result = next(s for s in tint.outputs if s.type == "RGBA")
    tree.links.new(result, shader.inputs["Color"])


def colored(material):
    """The shader of a material that has a base colour, and its input; (None, None) without one."""
    tree = material.node_tree
    out = tree and next((n for n in tree.nodes if n.type == "OUTPUT_MATERIAL" and n.is_active_output), None)
    links = out.inputs["Surface"].links if out else ()
    shader = links[0].from_node if links else None
    name = shader and COLORED.get(shader.type)
    return (shader, shader.inputs[name]) if name else (None, None)


def set_value(material, value):
    """Multiplies the base colour of a material by the background's value, in the place of an earlier one."""
    _, socket = colored(material)
    if socket is None:
        return False
    tree = material.node_tree
    if not socket.is_linked:
        now = list(socket.default_value)
        own = material.get(OWN_COLOR)
        was_set = material.get(SET_COLOR)
        if own is None or was_set is None or any(abs(a - b) > 1e-6 for a, b in zip(now, was_set)):
            own = now  # Nobody's but the user's.
        shown = [*(c * value for c in list(own)[:3]), own[3]]
        material[OWN_COLOR], material[SET_COLOR] = list(own), shown
        socket.default_value = shown
        return True
    node = socket.links[0].from_node
    if not (node.type == "MIX" and node.name.startswith(VALUE_NODE)):
        source = socket.links[0].from_socket
        node = tree.nodes.new("ShaderNodeMix")
        node.name = node.label = VALUE_NODE
        node.data_type, node.blend_type = "RGBA", "MULTIPLY"
        node.inputs["Factor"].default_value = 1.0
        tree.links.new(source, [s for s in node.inputs if s.type == "RGBA"][0])
        tree.links.new(next(s for s in node.outputs if s.type == "RGBA"), socket)
    [s for s in node.inputs if s.type == "RGBA"][1].default_value = (value, value, value, 1.0)
    return True


def adopt(scene):
    """Takes all that was set for the user's own, so that what is found next builds on it."""
    scene.pop(KEPT, None)
    for material in bpy.data.materials:
        for name in (OWN_COLOR, SET_COLOR):
            if name in material:
                del material[name]
        for node in material.node_tree.nodes if material.node_tree else ():
            if node.name.startswith(VALUE_NODE):
                node.name = node.label = "value"


def set_emission(spec):
    """Sets what a material emits."""
    material = bpy.data.materials.get(spec["material"])
    tree = material and material.node_tree
    if not tree:
        return False
    for node in tree.nodes:
        color = {"BSDF_PRINCIPLED": "Emission Color", "EMISSION": "Color"}.get(node.type)
        if color is None:
            continue
        strength = "Emission Strength" if node.type == "BSDF_PRINCIPLED" else "Strength"
        if not node.inputs[color].is_linked:
            node.inputs[color].default_value = (*spec["color"], 1.0)
        node.inputs[strength].default_value = spec["strength"]
        return True
    return False


def set_camera(spec):
    """Makes a camera and looks through it."""
    scene = bpy.context.scene
    data = bpy.data.cameras.new("lightopt camera")
    ob = bpy.data.objects.new("lightopt camera", data)
    scene.collection.objects.link(ob)
    data.sensor_fit, data.sensor_width, data.lens = "AUTO", spec["sensor"], spec["lens"]
    data.shift_x, data.shift_y = spec["shift"]
    if spec["focus"]:
        data.dof.use_dof = True
        data.dof.focus_distance = spec["focus"]["distance"]
        data.dof.aperture_fstop = spec["focus"]["fstop"]
    ob.matrix_world = Matrix(spec["matrix"])
    scene.camera = ob
    scene.render.resolution_x, scene.render.resolution_y = spec["size"]
    scene.render.resolution_percentage = 100


def set_view(name, stops):
    """Sets the view transform and the exposure, in stops."""
    view = bpy.context.scene.view_settings
    try:
        view.view_transform = name
    except TypeError:
        print(f"this Blender has no view transform {name}, which stays {view.view_transform}")
    view.look = "None"
    view.exposure, view.gamma = stops, 1.0


def read_scene(path):
    """Reads a scene file into an empty Blender."""
    bpy.ops.wm.read_factory_settings(use_empty=True)
    if path.endswith(".obj"):
        bpy.ops.wm.obj_import(filepath=path)
    else:
        bpy.ops.import_scene.gltf(filepath=path)
    for ob in [o for o in bpy.data.objects if o.type in {"LIGHT", "CAMERA"}]:
        bpy.data.objects.remove(ob)


def apply(data, folder=None):
    """Does what the data of a script say, and prints what is left to do by hand."""
    if folder is None:
        folder = os.path.dirname(os.path.abspath(globals().get("__file__", bpy.data.filepath)))
    if data["scene"]:
        read_scene(data["scene"])
    for spec in data["lamps"]:
        set_lamp(spec)
    if data["world"] is not None:
        set_world(data["world"], folder)
    for spec in data["emitters"]:
        if not set_emission(spec):
            print(f"material {spec['material']}: give it an emission of {spec['strength']:.4g}")
    for name in data["background"]:
        material = bpy.data.materials.get(name)
        if material is None or not set_value(material, data["value"]):
            print(f"material {name}: multiply its colour by {data['value']:.4g}")
    if data["scene"] or bpy.context.scene.camera is None:
        set_camera(data["camera"])
    set_view(data["view"], data["exposure"])
    known = {spec["name"] for spec in data["lamps"]}
    others = [o.name for o in bpy.context.scene.objects if o.type == "LIGHT" and not o.hide_render]
    others = [name for name in others if name not in known]
    if others:
        print(f"other lamps that shine: {', '.join(others)}")
