"""Lamps, world and camera of Blender in the terms of a sidecar, and found lamps in those of Blender.

A lamp's radiance is proportional to its power, so that one function says both what a lamp is and what power
makes a radiance. Radiometry is that of Cycles; setter.py and the program's export to Blender say the same from
the other side, and the tests compare them.
"""

import math
import os

import bpy
from mathutils import Matrix, Vector

# A sun with an angle becomes a disk as many radii of the scene away: its light then differs over the scene
# by twice the reciprocal, 0.2 %.
SUN_DISTANCE = 1000.0
LUMINANCE = (0.2126729, 0.7151522, 0.0721750)
VIEWS = {"Standard": "srgb", "AgX": "agx", "Filmic": "filmic", "Khronos PBR Neutral": "pbr-neutral", "Raw": "linear"}


def ours(v):
    """A vector of Blender, where z is up, with y up."""
    return [float(v[0]), float(v[2]), float(-v[1])]


def luminance(c):
    return sum(w * x for w, x in zip(LUMINANCE, c))


def emitted(light):
    """Colour of a lamp times the factors on its power: its temperature and its exposure."""
    color = list(light.color)
    if getattr(light, "use_temperature", False):
        color = [a * b for a, b in zip(color, light.temperature_color)]
    return [c * 2.0 ** getattr(light, "exposure", 0.0) for c in color]


def is_normalized(light):
    return getattr(light, "normalize", True)


def axes(matrix):
    """Unit x, y and -z of a lamp and the lengths of x and y."""
    x, y, z = (matrix.col[i].to_3d() for i in range(3))
    lengths = [max(v.length, 1e-12) for v in (x, y, z)]
    return [v / n for v, n in zip((x, y, -z), lengths)], lengths


def area_of(light, matrix):
    """Area of a lamp's surface, m²; 0 for a point."""
    if light.type == "AREA":
        _, (sx, sy, _) = axes(matrix)
        width = light.size * sx
        height = (light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size) * sy
        return width * height * (1.0 if light.shape in {"SQUARE", "RECTANGLE"} else math.pi / 4.0)
    if light.type in {"POINT", "SPOT"}:
        return 4.0 * math.pi * light.shadow_soft_size**2
    return 0.0


def mean_cosine(inner, outer):
    """Mean cosine of what a cone with these cosines lets through: the power of a disk over that of a sphere."""
    width = inner - outer
    disk = 0.5 * (1.0 - inner * inner) + width * (0.5 * outer + 0.35 * width)
    return disk / max(1.0 - inner + 0.5 * width, 1e-12)


def cone(light):
    """Cosines of a spot's cone, where its light begins to fall and where it ends."""
    outer = math.cos(light.spot_size / 2.0)
    return outer + light.spot_blend * (1.0 - outer), outer


def unit_radiance(light, matrix):
    """Radiance of a lamp of 1 W and luminance 1: W/(m² sr), of a point W/sr, of a sun W/m²."""
    if light.type == "SUN":
        # Without Normalize its strength is a radiance.
        half = min(light.angle / 2.0, math.radians(85.0))
        return 1.0 if is_normalized(light) or light.angle == 0.0 else math.pi * math.sin(half) ** 2
    area = area_of(light, matrix)
    if area == 0.0:
        return 1.0 / (4.0 * math.pi)
    # Of a spot Cycles makes a sphere, and the program a disk of the same power.
    share = mean_cosine(*cone(light)) if light.type == "SPOT" else 1.0
    return 1.0 / (math.pi * share * (area if is_normalized(light) else 1.0))


def look_at(position, direction):
    return ours(position + direction)


def of_lamp(ob, matrix, name, radius_of_scene, middle):
    """A lamp as a table of the sidecar, and what of it is not carried."""
    light, lost = ob.data, []
    position = matrix.to_translation()
    (x, y, shines), (sx, sy, sz) = axes(matrix)
    color = emitted(light)
    lum = luminance(color)
    table = {"name": name, "camera_visible": bool(ob.visible_camera)}
    if lum > 0.0:
        table["color"] = [c / lum for c in color]
    table["radiance"] = light.energy * lum * unit_radiance(light, matrix)
    if light.type == "AREA":
        half = light.size * sx / 2.0
        other = (light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size) * sy / 2.0
        table.update(position=ours(position), look_at=look_at(position, shines))
        if light.shape in {"SQUARE", "RECTANGLE"}:
            table.update(type="rectangle", half_extents=[half, other], up=ours(y))
        else:
            table.update(type="disk", radius=math.sqrt(half * other))
            if abs(half - other) > 1e-4 * half:
                lost.append("its ellipse becomes a disk of the same area")
        if light.spread < math.pi - 1e-4:
            lost.append("its spread: it shines into the whole half-space")
    elif light.type == "POINT":
        table["position"] = ours(position)
        if light.shadow_soft_size > 0.0:
            table.update(type="sphere", radius=float(light.shadow_soft_size))
        else:
            table["type"] = "point"
    elif light.type == "SPOT":
        outer = light.spot_size / 2.0
        inner = math.acos(cone(light)[0])
        table.update(type="spot", position=ours(position), look_at=look_at(position, shines),
                     radius=float(light.shadow_soft_size), angle=math.degrees(outer),
                     softness=min(max(1.0 - inner / outer, 0.0), 1.0))
        if light.use_square:
            lost.append("its square cone becomes a round one")
        if light.shadow_soft_size > 0.0:
            lost.append("it is a disk here and a sphere in Cycles: as bright as a whole, darker at its edge")
        if max(abs(sx - sy), abs(sx - sz)) > 1e-4 * sx:
            lost.append("its cone is stretched by the object's scale")
    else:
        table["movable"] = False
        if light.angle > 0.0:
            half = min(light.angle / 2.0, math.radians(85.0))
            distance = SUN_DISTANCE * radius_of_scene
            table.update(type="disk", position=ours(middle - shines * distance), look_at=ours(middle),
                         radius=distance * math.tan(half))
            table["radiance"] /= math.pi * math.sin(half) ** 2
        else:
            table.update(type="distant", look_at=ours(shines))
    if getattr(light, "use_soft_falloff", False) and light.type in {"POINT", "SPOT"} and light.shadow_soft_size > 0.0:
        lost.append("Soft Falloff, which Apply turns off: up to 3 % darker in Cycles without it")
    return table, lost + other_losses(ob)


def other_losses(ob):
    """What of a lamp has no counterpart, whatever its type."""
    light, lost = ob.data, []
    tree = light.node_tree if getattr(light, "use_nodes", False) else None
    if tree is not None:
        kinds = {n.type for n in tree.nodes} - {"EMISSION", "OUTPUT_LIGHT"}
        emission = next((n for n in tree.nodes if n.type == "EMISSION"), None)
        plain = emission and not any(s.is_linked for s in emission.inputs) and \
            abs(emission.inputs["Strength"].default_value - 1.0) < 1e-6 and \
            all(abs(c - 1.0) < 1e-6 for c in list(emission.inputs["Color"].default_value)[:3])
        if "TEX_IES" in kinds:
            lost.append("its IES profile")
        elif kinds or not plain:
            lost.append("its node tree")
    linking = getattr(ob, "light_linking", None)
    if linking and (linking.receiver_collection or linking.blocker_collection):
        lost.append("light linking")
    if not light.use_shadow:
        lost.append("that it casts no shadows")
    if getattr(light.cycles, "max_bounces", 1024) < 8:
        lost.append("its limit of bounces")
    for share in ("diffuse_factor", "specular_factor", "transmission_factor"):
        if abs(getattr(light, share, 1.0) - 1.0) > 1e-6:
            lost.append(f"its {share.replace('_', ' ')}")
    if not (ob.visible_diffuse and ob.visible_glossy and ob.visible_transmission):
        lost.append("its ray visibility")
    return lost


def is_without_size(table):
    """Whether a lamp of the sidecar is one that no ray of Cycles can meet."""
    return table["type"] in {"point", "distant"} or table["type"] == "spot" and not table.get("radius")


def background_of(world):
    """The Background node whose light the world is, and its picture's node and mapping; None where the world is
    another tree."""
    tree = world.node_tree if getattr(world, "use_nodes", True) else None
    out = tree and next((n for n in tree.nodes if n.type == "OUTPUT_WORLD" and n.is_active_output), None)
    if out is None or not out.inputs["Surface"].is_linked:
        return None
    node = out.inputs["Surface"].links[0].from_node
    if node.type != "BACKGROUND" or node.inputs["Strength"].is_linked:
        return None
    if not node.inputs["Color"].is_linked:
        return node, None, None
    picture = node.inputs["Color"].links[0].from_node
    if picture.type != "TEX_ENVIRONMENT" or picture.image is None or picture.projection != "EQUIRECTANGULAR":
        return None
    if not picture.inputs["Vector"].is_linked:
        return node, picture, None
    mapping = picture.inputs["Vector"].links[0].from_node
    if mapping.type == "TEX_COORD":
        return node, picture, None
    turns_only = mapping.type == "MAPPING" and not any(
        mapping.inputs[n].is_linked for n in ("Location", "Rotation", "Scale")) and all(
        abs(v) < 1e-6 for v in list(mapping.inputs["Rotation"].default_value)[:2]) and all(
        abs(v - 1.0) < 1e-6 for v in mapping.inputs["Scale"].default_value)
    return (node, picture, mapping) if turns_only else None


def of_world(world, folder, name):
    """The world as a table of the sidecar, or None where it is black, and what of it is not carried."""
    if world is None:
        return None, []
    lost = []
    table = {"name": name, "type": "environment", "movable": False,
             "camera_visible": bool(world.cycles_visibility.camera) and not bpy.context.scene.render.film_transparent}
    if not getattr(world, "use_nodes", True):
        color, strength, picture, mapping = list(world.color), 1.0, None, None
    else:
        found = background_of(world)
        if found is None:
            return None, ["world: its node tree; use one Background with a colour or an Environment Texture"]
        node, picture, mapping = found
        color, strength = list(node.inputs["Color"].default_value)[:3], node.inputs["Strength"].default_value
        out = next(n for n in world.node_tree.nodes if n.type == "OUTPUT_WORLD" and n.is_active_output)
        if out.inputs["Volume"].is_linked:
            lost.append("world: its volume")
    if strength <= 0.0:
        return None, lost
    if picture is None:
        lum = luminance(color)
        if lum <= 0.0:
            return None, lost
        table.update(color=[c / lum for c in color], radiance=strength * lum)
        return table, lost
    turn = mapping.inputs["Rotation"].default_value[2] if mapping else 0.0
    table.update(radiance=strength, rotation=90.0 - math.degrees(turn), image=picture_file(picture.image, folder))
    return table, lost


def picture_file(image, folder):
    """A file with the world's picture: its own, or one that is written for what is packed or made."""
    path = bpy.path.abspath(image.filepath, library=image.library)
    if image.source == "FILE" and not image.packed_file and os.path.isfile(path):
        return os.path.abspath(path)
    out = os.path.join(folder, "world.exr")
    settings = bpy.context.scene.render.image_settings
    kept = (settings.file_format, settings.color_depth)
    try:
        settings.file_format, settings.color_depth = "OPEN_EXR", "32"
        image.save_render(out)
    finally:
        settings.file_format, settings.color_depth = kept
    return out


def of_camera(scene):
    """The camera as a table of the sidecar, and what of it is not carried. Raises ValueError without one."""
    ob = scene.camera
    if ob is None:
        raise ValueError("the scene has no camera")
    camera, render, lost = ob.data, scene.render, []
    if camera.type != "PERSP":
        raise ValueError(f"the camera `{ob.name}` is not a perspective one")
    ob = ob.evaluated_get(bpy.context.evaluated_depsgraph_get())
    share = render.resolution_percentage / 100.0
    width, height = (max(1, int(n * share)) for n in (render.resolution_x, render.resolution_y))
    if abs(render.pixel_aspect_x - render.pixel_aspect_y) > 1e-6:
        lost.append("camera: pixels that are not square")
    if render.use_border:
        lost.append("camera: the render region; the whole picture is lit")
    fit = camera.sensor_fit
    if fit == "AUTO":
        fit, sensor = ("HORIZONTAL" if width >= height else "VERTICAL"), camera.sensor_width
    else:
        sensor = camera.sensor_width if fit == "HORIZONTAL" else camera.sensor_height
    along = width if fit == "HORIZONTAL" else height
    half = sensor / (2.0 * camera.lens) * height / along
    matrix = ob.matrix_world
    position = matrix.to_translation()
    (_, up, ahead), _ = axes(matrix)
    table = {
        "position": ours(position), "look_at": look_at(position, ahead), "up": ours(up),
        "vfov": math.degrees(2.0 * math.atan(half)), "size": [width, height],
        # In lengths of the longer side; Blender's are of the side that the sensor fits.
        "shift": [s * along / max(width, height) for s in (camera.shift_x, camera.shift_y)],
    }
    if camera.dof.use_dof:
        table["aperture_radius"] = camera.lens / 1000.0 / (2.0 * camera.dof.aperture_fstop)
        target = camera.dof.focus_object
        distance = (target.matrix_world.to_translation() - position).dot(ahead) if target else camera.dof.focus_distance
        table["focus_distance"] = max(distance, 1e-3)
        if camera.dof.aperture_blades or abs(camera.dof.aperture_ratio - 1.0) > 1e-6:
            lost.append("camera: the form of its aperture")
    return table, lost


def of_view(scene):
    """View and exposure of the sidecar, and what of the colour management is not carried."""
    view, lost = scene.view_settings, []
    name = VIEWS.get(view.view_transform)
    if name is None:
        known = "AgX, Filmic, Standard, Khronos PBR Neutral and Raw"
        lost.append(f"view transform {view.view_transform}: measured as Standard; known are {known}")
    if view.look not in {"None", ""}:
        lost.append(f"look {view.look}")
    if abs(view.gamma - 1.0) > 1e-6:
        lost.append("gamma of the view")
    if view.use_curve_mapping:
        lost.append("curves of the view")
    if getattr(view, "use_white_balance", False):
        lost.append("white balance")
    # In Blender 5 a node group, before it a tree of the scene's own.
    group = scene.compositing_node_group if hasattr(scene, "compositing_node_group") else (
        scene.use_nodes and scene.node_tree)
    if scene.render.use_compositing and group:
        lost.append("what the compositor does")
    exposure = 2.0**view.exposure * getattr(scene.cycles, "film_exposure", 1.0)
    return {"view": name or "srgb", "exposure": exposure}, lost


def placed_settings(placed, radiance, size, color):
    """Type, settings and matrix of a lamp that the program placed, for setter.set_lamp."""
    at, toward = (Vector((p[0], -p[2], p[1])) for p in (placed["position"], placed["look_at"]))
    z = (at - toward).normalized()
    x = Vector((0.0, 0.0, 1.0)).cross(z)
    x = x.normalized() if x.length > 1e-6 else Vector((1.0, 0.0, 0.0))
    rotation = Matrix((x, z.cross(x), z)).transposed().to_4x4()
    matrix = Matrix.Translation(at) @ rotation
    most = max(color)
    power = radiance * most
    kind, settings = "AREA", {}
    if placed["type"] == "rectangle":
        a, b = (h * size for h in placed["half_extents"])
        settings = {"shape": "RECTANGLE", "size": 2 * a, "size_y": 2 * b, "energy": 4 * math.pi * a * b * power}
    elif placed["type"] == "disk":
        r = placed["radius"] * size
        settings = {"shape": "DISK", "size": 2 * r, "energy": math.pi**2 * r * r * power}
    else:
        r, outer = placed["radius"] * size, math.radians(placed["angle"])
        inner = outer * (1.0 - placed.get("softness", 0.2))
        blend = (math.cos(inner) - math.cos(outer)) / (1.0 - math.cos(outer))
        kind = "SPOT"
        settings = {"shadow_soft_size": r, "use_soft_falloff": False, "spot_size": 2 * outer, "spot_blend": blend,
                    "energy": 4 * math.pi * power}
        if r > 0.0:
            settings["energy"] *= math.pi * r * r * mean_cosine(math.cos(inner), math.cos(outer))
    settings["color"] = [c / most for c in color]
    return {"type": kind, "settings": settings, "matrix": [list(row) for row in matrix], "visible": False}
