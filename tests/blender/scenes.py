"""Scenes made in Blender, as users make them, on which the add-on is tried."""

import math

import bpy
import numpy as np
from mathutils import Vector


def empty(view):
    bpy.ops.wm.read_factory_settings(use_empty=True)
    scene = bpy.context.scene
    scene.view_settings.view_transform = view
    scene.view_settings.look = "None"
    scene.render.resolution_percentage = 100
    return scene


def material(name, color, roughness=None, metallic=0.0):
    """A Diffuse BSDF, or with a roughness a Principled one."""
    m = bpy.data.materials.new(name)
    m.use_nodes = True
    tree = m.node_tree
    if roughness is None:
        tree.nodes.clear()
        node = tree.nodes.new("ShaderNodeBsdfDiffuse")
        node.inputs["Color"].default_value = (*color, 1)
        out = tree.nodes.new("ShaderNodeOutputMaterial")
        tree.links.new(node.outputs[0], out.inputs["Surface"])
    else:
        node = next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED")
        node.inputs["Base Color"].default_value = (*color, 1)
        node.inputs["Roughness"].default_value = roughness
        node.inputs["Metallic"].default_value = metallic
    return m


def add(kind, name, location, of=None, scale=1.0, **more):
    getattr(bpy.ops.mesh, f"primitive_{kind}_add")(location=location, **more)
    ob = bpy.context.object
    ob.name, ob.scale = name, (scale, scale, scale)
    if of:
        ob.data.materials.append(of)
    return ob


def sweep(of, width=8.0, front=4.0, back=3.0, height=4.0, radius=1.2):
    """A seamless backdrop."""
    profile = [(-front, 0.0), (back - radius, 0.0)]
    profile += [(back - radius + radius * math.sin(a), radius * (1 - math.cos(a)))
                for a in np.linspace(0, math.pi / 2, 13)[1:]]
    profile.append((back, height))
    v = [(x, y, z) for y, z in profile for x in (-width / 2, width / 2)]
    f = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(len(profile) - 1)]
    mesh = bpy.data.meshes.new("sweep")
    mesh.from_pydata(v, [], f)
    mesh.materials.append(of)
    for p in mesh.polygons:
        p.use_smooth = True
    ob = bpy.data.objects.new("sweep", mesh)
    bpy.context.scene.collection.objects.link(ob)


def lamp(kind, name, location, target=(0, 0, 0.5), **settings):
    data = bpy.data.lights.new(name, kind)
    for key, value in settings.items():
        setattr(data, key, value)
    ob = bpy.data.objects.new(name, data)
    ob.location = location
    ob.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(ob)
    return ob


def camera(location, target, size, lens=50.0, shift=(0, 0), fit="AUTO"):
    data = bpy.data.cameras.new("Camera")
    data.lens, data.sensor_fit = lens, fit
    data.shift_x, data.shift_y = shift
    ob = bpy.data.objects.new("Camera", data)
    ob.location = location
    ob.rotation_euler = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    scene = bpy.context.scene
    scene.collection.objects.link(ob)
    scene.camera = ob
    scene.render.resolution_x, scene.render.resolution_y = size
    return ob


def select(*objects):
    for ob in bpy.context.scene.objects:
        ob.select_set(ob in objects)


def studio():
    """Diffuse materials; a subdivided monkey, an array, an area and a point lamp, one of them coloured."""
    empty("Standard")
    sweep(material("paper", (0.6, 0.6, 0.6)))
    monkey = add("monkey", "monkey", (0, 0, 0.85), material("clay", (0.7, 0.4, 0.3)), scale=0.8)
    subdivision = monkey.modifiers.new("subdivision", "SUBSURF")
    subdivision.levels, subdivision.render_levels = 0, 2
    # The render shows what the viewport hides.
    monkey.hide_viewport = True
    posts = add("cube", "posts", (-1.8, 1.2, 0.5), material("slate", (0.2, 0.25, 0.35)), scale=0.25)
    array = posts.modifiers.new("array", "ARRAY")
    array.count, array.relative_offset_displace = 4, (1.8, 0, 0)
    lamp("AREA", "Key", (1.8, -2.0, 2.6), shape="RECTANGLE", size=0.9, size_y=0.5, energy=120.0,
         color=(1.0, 0.85, 0.7))
    lamp("POINT", "Lämpchen.001", (-2.0, -1.0, 1.6), energy=40.0, shadow_soft_size=0.15)
    camera((0.3, -5.0, 1.5), (0, 0, 0.8), (128, 96))
    group = bpy.data.collections.new("subject")
    group.objects.link(monkey)
    bpy.context.scene.collection.children.link(group)


def portrait():
    """A portrait camera with a shift; a collection of parts in instances; a spot, a sun with an angle, a parent."""
    scene = empty("AgX")
    sweep(material("wall", (0.45, 0.5, 0.55), roughness=0.9))
    body = material("ceramic", (0.75, 0.72, 0.65), roughness=0.35)
    vase = add("uv_sphere", "vase", (0, 0, 0.6), body, scale=0.6, segments=48, ring_count=24)
    bpy.ops.object.shade_smooth()
    neck = add("cylinder", "neck", (0, 0, 1.25), body, scale=0.22, vertices=48)
    neck.parent = vase
    neck.matrix_parent_inverse = vase.matrix_world.inverted()
    fruit = bpy.data.collections.new("fruit")
    ball = add("ico_sphere", "ball", (0, 0, 0), material("peel", (0.6, 0.3, 0.08), roughness=0.5), scale=0.2,
               subdivisions=4)
    for c in list(ball.users_collection):
        c.objects.unlink(ball)
    fruit.objects.link(ball)
    for i, place in enumerate([(0.9, -0.2, 0.2), (-0.85, 0.3, 0.2), (0.7, 0.8, 0.2)]):
        instance = bpy.data.objects.new(f"fruit {i}", None)
        instance.instance_type, instance.instance_collection = "COLLECTION", fruit
        instance.location = place
        scene.collection.objects.link(instance)
    hidden = add("cube", "hidden", (0, -1.0, 0.5), body)
    hidden.hide_render = True
    lamp("SPOT", "Spot", (-1.6, -1.8, 2.8), target=(0, 0, 0.7), energy=500.0, spot_size=0.9, spot_blend=0.5,
         shadow_soft_size=0.0)
    lamp("SUN", "Sun", (3, -2, 4), energy=1.2, angle=math.radians(6.0))
    camera((0, -5.5, 1.3), (0, 0, 0.9), (96, 128), lens=60.0, shift=(0.03, -0.05), fit="VERTICAL")
    select(vase)


def hdri():
    """A turned picture of the surroundings, metal and gloss, a disk lamp with a temperature, exposure, a lens."""
    scene = empty("AgX")
    scene.view_settings.exposure = 0.5
    floor = material("wood", (0.4, 0.28, 0.18), roughness=0.6)
    add("plane", "floor", (0, 0, 0), floor, size=12.0)
    add("cube", "plinth", (0, 0, 0.15), material("stone", (0.5, 0.5, 0.48)), size=1.4).scale = (1, 1, 0.3 / 1.4)
    torus = add("torus", "ring", (0, 0, 0.75), material("copper", (0.9, 0.55, 0.4), roughness=0.35, metallic=1.0),
                major_radius=0.45, minor_radius=0.16, major_segments=64, minor_segments=32)
    bpy.ops.object.shade_smooth()
    torus.rotation_euler = (1.2, 0.2, 0.4)
    ball = add("uv_sphere", "ball", (0.9, -0.5, 0.25), material("blue", (0.1, 0.2, 0.5), roughness=0.25), scale=0.25,
               segments=48, ring_count=24)
    bpy.ops.object.shade_smooth()
    twin = bpy.data.objects.new("twin", ball.data)
    twin.location, twin.scale = (-0.95, -0.35, 0.2), (0.2, 0.2, 0.2)
    scene.collection.objects.link(twin)
    width, height = 128, 64
    image = bpy.data.images.new("sky", width, height, float_buffer=True)
    y, x = np.mgrid[0:height, 0:width]
    up = np.sin((y / (height - 1) - 0.5) * math.pi)
    glow = np.exp(-((x - 90) ** 2 + (y - 44) ** 2) / 60.0)
    rgb = np.stack([0.25 + 0.2 * up + 9.0 * glow, 0.3 + 0.25 * up + 7.5 * glow, 0.4 + 0.35 * up + 5.5 * glow], -1)
    image.pixels.foreach_set(np.concatenate([np.maximum(rgb, 0.02), np.ones((height, width, 1))], -1)
                             .astype(np.float32).ravel())
    image.pack()
    world = scene.world = bpy.data.worlds.new("World")
    world.use_nodes = True
    tree = world.node_tree
    background = next(n for n in tree.nodes if n.type == "BACKGROUND")
    background.inputs["Strength"].default_value = 0.8
    picture = tree.nodes.new("ShaderNodeTexEnvironment")
    picture.image = image
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.inputs["Rotation"].default_value[2] = math.radians(70.0)
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], picture.inputs["Vector"])
    tree.links.new(picture.outputs["Color"], background.inputs["Color"])
    lamp("AREA", "Disk", (-1.8, -1.6, 2.2), shape="DISK", size=0.6, energy=60.0, use_temperature=True,
         temperature=3200.0)
    view = camera((0.4, -4.2, 1.6), (0, 0, 0.6), (128, 96), lens=55.0)
    view.data.dof.use_dof = True
    view.data.dof.focus_distance, view.data.dof.aperture_fstop = 4.2, 2.0
    select(torus)


def still():
    """An image on the floor, a bar that shines, text, a curve, instances by geometry nodes, a mirrored object, and a
    Metallic BSDF."""
    scene = empty("Filmic")
    floor = material("tiles", (0.5, 0.5, 0.5), roughness=0.7)
    tree = floor.node_tree
    tiles = bpy.data.images.new("tiles", 64, 64)
    y, x = np.mgrid[0:64, 0:64]
    code = np.where(((x // 8 + y // 8) % 2)[..., None] == 0, [0.8, 0.75, 0.7, 1.0], [0.45, 0.4, 0.4, 1.0])
    tiles.pixels.foreach_set(code.astype(np.float32).ravel())
    tiles.pack()
    picture = tree.nodes.new("ShaderNodeTexImage")
    picture.image = tiles
    tree.links.new(picture.outputs["Color"], next(n for n in tree.nodes if n.type == "BSDF_PRINCIPLED").inputs["Base Color"])
    sweep(material("wall", (0.55, 0.55, 0.6)))
    add("plane", "floor", (0, 0, 0.001), floor, size=6.0)
    brass = bpy.data.materials.new("brass")
    brass.use_nodes = True
    brass.node_tree.nodes.clear()
    metal = brass.node_tree.nodes.new("ShaderNodeBsdfMetallic")
    metal.inputs["Base Color"].default_value, metal.inputs["Roughness"].default_value = (0.9, 0.75, 0.4, 1), 0.2
    brass.node_tree.links.new(metal.outputs[0], brass.node_tree.nodes.new("ShaderNodeOutputMaterial").inputs[0])
    pot = add("cylinder", "pot", (0, 0, 0.4), brass, radius=0.4, depth=0.8, vertices=64)
    bpy.ops.object.shade_auto_smooth(angle=0.6)
    bar = bpy.data.materials.new("neon")
    bar.use_nodes = True
    bar.node_tree.nodes.clear()
    shine = bar.node_tree.nodes.new("ShaderNodeEmission")
    shine.inputs["Color"].default_value, shine.inputs["Strength"].default_value = (1.0, 0.4, 0.6, 1), 6.0
    bar.node_tree.links.new(shine.outputs[0], bar.node_tree.nodes.new("ShaderNodeOutputMaterial").inputs[0])
    add("cube", "neon", (-1.3, 0.6, 0.9), bar, size=1.0).scale = (0.06, 0.06, 1.4)
    bpy.ops.object.text_add(location=(0.6, 0.5, 0.02), rotation=(math.pi / 2, 0, 0))
    text = bpy.context.object
    text.data.body, text.data.extrude, text.data.size = "ab", 0.05, 0.6
    text.data.materials.append(material("letters", (0.7, 0.2, 0.15)))
    text.scale = (-1, 1, 1)
    text.location.x += 0.7
    bpy.ops.curve.primitive_bezier_circle_add(radius=0.5, location=(-0.6, -0.9, 0.06))
    bpy.context.object.data.bevel_depth = 0.05
    bpy.context.object.data.materials.append(material("wire", (0.2, 0.5, 0.3), roughness=0.4))
    half = add("cube", "half", (1.0, -0.8, 0.15), material("wood", (0.5, 0.35, 0.2)), scale=0.15)
    half.modifiers.new("mirror", "MIRROR").use_axis = (True, False, False)
    half.data.transform(__import__("mathutils").Matrix.Translation((1.2, 0, 0)))
    pebble = add("ico_sphere", "pebble", (0, 0, -5), material("pebble", (0.4, 0.4, 0.45)), subdivisions=3, radius=0.08)
    pebble.hide_render = True
    group = bpy.data.node_groups.new("scatter", "GeometryNodeTree")
    group.interface.new_socket("Geometry", in_out="INPUT", socket_type="NodeSocketGeometry")
    group.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    start, end = group.nodes.new("NodeGroupInput"), group.nodes.new("NodeGroupOutput")
    on_points, info = group.nodes.new("GeometryNodeInstanceOnPoints"), group.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value = pebble
    group.links.new(start.outputs[0], on_points.inputs["Points"])
    group.links.new(info.outputs["Geometry"], on_points.inputs["Instance"])
    group.links.new(on_points.outputs[0], end.inputs[0])
    ring = add("circle", "ring", (0, 0, 0.08), radius=0.75, vertices=9)
    ring.modifiers.new("scatter", "NODES").node_group = group
    lamp("AREA", "Key", (1.8, -2.2, 2.4), shape="SQUARE", size=0.8, energy=110.0)
    lamp("POINT", "Bulb", (-1.2, -1.6, 1.4), energy=30.0, shadow_soft_size=0.05)
    camera((0.4, -4.6, 1.7), (0, 0, 0.45), (96, 128), lens=40.0, shift=(0.04, 0.02), fit="HORIZONTAL")
    select(pot)


def glass(name, color, roughness, ior=1.45):
    """A Principled BSDF that lets all light pass."""
    m = material(name, color, roughness)
    inputs = next(n for n in m.node_tree.nodes if n.type == "BSDF_PRINCIPLED").inputs
    inputs["Transmission Weight"].default_value, inputs["IOR"].default_value = 1.0, ior
    return m


def vitrine():
    """Glass: smooth with Blender's own base colour of 0.8, rough and coloured, a Glass BSDF; metal with an edge tint, a
    world's colour."""
    scene = empty("Standard")
    sweep(material("paper", (0.6, 0.6, 0.6)), width=6.0, front=3.0, back=2.0, height=3.0, radius=0.8)
    ball = add("uv_sphere", "ball", (0, 0, 0.55), glass("clear", (0.8, 0.8, 0.8), 0.0), scale=0.5, segments=64, ring_count=32)
    bpy.ops.object.shade_smooth()
    add("uv_sphere", "frosted", (-0.95, 0.3, 0.36), glass("frost", (0.9, 0.6, 0.4), 0.3), scale=0.35, segments=48,
        ring_count=24)
    bpy.ops.object.shade_smooth()
    block = material("block", (0, 0, 0))
    tree = block.node_tree
    shader = tree.nodes.new("ShaderNodeBsdfGlass")
    shader.inputs["Color"].default_value, shader.inputs["Roughness"].default_value = (0.5, 0.8, 0.7, 1), 0.0
    tree.links.new(shader.outputs[0], next(n for n in tree.nodes if n.type == "OUTPUT_MATERIAL").inputs["Surface"])
    add("cube", "block", (-0.55, -0.75, 0.17), block, size=0.3)
    steel = material("steel", (0.8, 0.78, 0.75), roughness=0.3, metallic=1.0)
    next(n for n in steel.node_tree.nodes if n.type == "BSDF_PRINCIPLED").inputs["Specular Tint"].default_value = \
        (0.6, 0.7, 0.8, 1)
    add("uv_sphere", "metal", (1.0, 0.6, 0.36), steel, scale=0.35, segments=48, ring_count=24)
    bpy.ops.object.shade_smooth()
    lamp("AREA", "Key", (1.5, -1.8, 2.4), shape="RECTANGLE", size=0.9, size_y=0.6, energy=90.0)
    lamp("POINT", "Bulb", (-1.6, -1.0, 1.6), energy=35.0, shadow_soft_size=0.12)
    world = scene.world = bpy.data.worlds.new("World")
    background = next(n for n in world.node_tree.nodes if n.type == "BACKGROUND")
    background.inputs["Color"].default_value, background.inputs["Strength"].default_value = (0.4, 0.55, 0.8, 1), 0.3
    camera((0.3, -4.5, 1.6), (0, 0, 0.6), (128, 96))
    select(ball)


SCENES = {"studio": (studio, True), "portrait": (portrait, False), "hdri": (hdri, False), "still": (still, False),
          "vitrine": (vitrine, False)}
