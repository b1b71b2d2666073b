"""Materials: what Blender's glTF exporter loses of them, and stand-ins for what it would drop.

The exporter knows the Principled BSDF. Of another shader it writes a white material; while it works, such a
material shows a Principled BSDF of the same colour, so that images and normal maps come along, and the sidecar
says what it is.
"""

import math
from contextlib import contextmanager

from . import setter

# Inputs of the Principled BSDF that have no counterpart, with the value at which they do nothing.
UNKNOWN = {
    "Subsurface Weight": "subsurface scattering", "Sheen Weight": "sheen", "Coat Weight": "its coat",
    "Anisotropic": "anisotropy", "Thin Film Thickness": "its thin film", "Diffuse Roughness": "diffuse roughness",
}
# Transmission from which a Principled BSDF is glass: the program has nothing between glass and opaque.
GLASS = 0.5


def output(material):
    tree = material.node_tree
    return tree and next((n for n in tree.nodes if n.type == "OUTPUT_MATERIAL" and n.is_active_output), None)


def shader_of(material):
    """The shader of a material's surface; None without one."""
    out = output(material)
    if out is None or not out.inputs["Surface"].is_linked:
        return None
    return out.inputs["Surface"].links[0].from_node


def color(socket):
    return [float(c) for c in list(socket.default_value)[:3]]


def number(node, name):
    """The number of an input; None where an image decides."""
    socket = node.inputs.get(name)
    return None if socket is None or socket.is_linked else float(socket.default_value)


def as_schlick(mean):
    """Reflectance at normal incidence of a metal after Schlick that is as bright under a white sky as a mirror of the
    reflectance `mean` at any angle."""
    return min(max((21.0 * mean - 1.0) / 20.0, 0.0), 1.0)


def tint(node, name):
    """The colour of a glass in [0, 1], and whether an image, which is lost, decides it."""
    socket = node.inputs[name]
    return ([1.0] * 3, True) if socket.is_linked else ([min(max(c, 0.0), 1.0) for c in color(socket)], False)


def as_glass(face, is_image):
    """What the sidecar says of glass of which each face lets the colour `face` pass.

    The model is that of the glTF, where a surface that is open is a thin sheet. Cycles meets one face of it, and does
    not divide by the square of the IOR what it sees through that; the colour of the sheet, its base colour, is the face's."""
    return {"transmitted": face} if is_image else {"transmitted": face, "base_color": face}


def principled(node):
    """What the sidecar says of a Principled BSDF beyond its glTF, and what of it is not carried."""
    lost = [words for name, words in UNKNOWN.items() if node.inputs.get(name) is not None
            and (node.inputs[name].is_linked or number(node, name) > 1e-6)]
    ior, metallic, transmission = (number(node, n) for n in ("IOR", "Metallic", "Transmission Weight"))
    specular_tint = node.inputs.get("Specular Tint")
    is_tinted = specular_tint is not None and (specular_tint.is_linked or min(color(specular_tint)) < 0.99
                                               or max(color(specular_tint)) > 1.01)
    if is_tinted and (metallic != 1.0 or specular_tint.is_linked):
        lost.append("the tint of its specular reflection")
    if metallic == 1.0:
        # Where all is at the format's default the exporter writes nothing at all.
        metal = {"model": "conductor", "roughness": number(node, "Roughness")}
        if not node.inputs["Base Color"].is_linked:
            metal["base_color"] = [min(max(c, 0.0), 1.0) for c in color(node.inputs["Base Color"])]
        if specular_tint is not None and not specular_tint.is_linked:
            # To a metal it is the tint of its edge.
            metal["edge_tint"] = tint(node, "Specular Tint")[0]
        return {k: v for k, v in metal.items() if v is not None}, lost
    table = {} if ior is None else {"ior": min(max(ior, 1.001), 4.0)}
    if transmission is None or 0.0 < transmission < 1.0:
        lost.append("its share of transmission: it is glass as a whole, or not at all")
    if (transmission or 0.0) >= GLASS:
        own, is_lost = tint(node, "Base Color")
        if is_lost:
            lost.append("the image that tints its glass")
        return {**table, **as_glass([math.sqrt(c) for c in own], is_lost)}, lost
    level = number(node, "Specular IOR Level")
    if ior is not None and level is not None and abs(level - 0.5) > 1e-6:
        # The level scales the reflectance at normal incidence, which another IOR has.
        f0 = 2.0 * level * ((ior - 1.0) / (ior + 1.0)) ** 2
        root = math.sqrt(min(f0, 0.36))
        table = {"ior": (1.0 + root) / (1.0 - root), "specular": 1.0} if root > 1e-3 else {"specular": 0.0}
    return table, lost


def described(material):
    """What the sidecar says of a material, and what of it is not carried."""
    node, lost = shader_of(material), []
    out = output(material)
    if out is not None and out.inputs["Volume"].is_linked:
        lost.append("its volume")
    if out is not None and out.inputs["Displacement"].is_linked:
        lost.append("displacement")
    if node is None:
        return {}, lost + (["a surface without a shader"] if getattr(material, "use_nodes", True) else [])
    roughness = number(node, "Roughness")
    known = {
        "BSDF_DIFFUSE": lambda: {"model": "diffuse"},
        "BSDF_GLOSSY": lambda: {"model": "conductor", "roughness": roughness},
        "BSDF_METALLIC": lambda: {"model": "conductor", "roughness": roughness},
        "BSDF_GLASS": lambda: {"roughness": roughness, "ior": number(node, "IOR")},
        "EMISSION": lambda: {"model": "diffuse", "base_color": [0.0, 0.0, 0.0]},
    }
    if node.type == "BSDF_PRINCIPLED":
        table, gone = principled(node)
        return table, lost + gone
    if node.type not in known:
        return {}, lost + [f"its shader ({node.bl_label})"]
    table = known[node.type]()
    socket = setter.COLORED.get(node.type)
    if socket and not node.inputs[socket].is_linked:
        table["base_color"] = [min(max(c, 0.0), 1.0) for c in color(node.inputs[socket])]
    if node.type == "BSDF_METALLIC" and node.fresnel_type != "F82":
        lost.append("its conductor by index and extinction")
    elif node.type == "BSDF_METALLIC":
        table["edge_tint"], is_lost = tint(node, "Edge Tint")
        if is_lost:
            lost.append("the image of its edge tint")
    if node.type == "BSDF_GLOSSY" and "base_color" in table:
        table["base_color"] = [as_schlick(c) for c in table["base_color"]]
        lost.append("that it mirrors as much at every angle: as bright as a whole")
    if node.type == "BSDF_DIFFUSE" and number(node, "Roughness"):
        lost.append("roughness of the diffuse shader")
    if node.type == "BSDF_GLASS":
        own, is_lost = tint(node, "Color")
        table.update(as_glass(own, is_lost), reflected=own)
        if is_lost:
            lost.append("the image that tints its glass")
    if node.type == "EMISSION" and not any(s.is_linked for s in node.inputs):
        table["emission"] = [c * number(node, "Strength") for c in color(node.inputs["Color"])]
    return {k: v for k, v in table.items() if v is not None}, lost


def is_smooth(material):
    """Whether a material is smooth glass or a mirror, which cast caustics."""
    node = shader_of(material)
    if node is None or node.type not in {"BSDF_GLASS", "BSDF_GLOSSY", "BSDF_METALLIC", "BSDF_PRINCIPLED"}:
        return False
    shares = [number(node, name) or 0.0 for name in ("Metallic", "Transmission Weight")]
    roughness = number(node, "Roughness")
    return roughness is not None and roughness < 0.01 and (node.type != "BSDF_PRINCIPLED" or max(shares) >= GLASS)


@contextmanager
def stand_ins(materials):
    """While it is open, shaders that the exporter does not know are Principled ones of the same colour."""
    added = []
    try:
        for material in materials:
            node = shader_of(material)
            if node is None or node.type == "BSDF_PRINCIPLED" or material.library:
                continue
            tree, out = material.node_tree, output(material)
            stand_in = tree.nodes.new("ShaderNodeBsdfPrincipled")
            added.append((tree, node, stand_in, out, out.inputs["Surface"].links[0].from_socket))
            pairs = [("Color", "Base Color"), ("Base Color", "Base Color"), ("Roughness", "Roughness"), ("Normal", "Normal")]
            if node.type == "EMISSION":
                pairs = [("Color", "Emission Color"), ("Strength", "Emission Strength")]
                stand_in.inputs["Base Color"].default_value = (0.0, 0.0, 0.0, 1.0)
            for theirs, own in pairs:
                source = node.inputs.get(theirs)
                if source is None:
                    continue
                if source.is_linked:
                    tree.links.new(source.links[0].from_socket, stand_in.inputs[own])
                elif own != "Normal":
                    stand_in.inputs[own].default_value = source.default_value
            stand_in.inputs["Metallic"].default_value = 1.0 if node.type in {"BSDF_GLOSSY", "BSDF_METALLIC"} else 0.0
            if node.type == "BSDF_GLASS":
                stand_in.inputs["Transmission Weight"].default_value = 1.0
            tree.links.new(stand_in.outputs[0], out.inputs["Surface"])
        yield
    finally:
        for tree, _, stand_in, out, source in added:
            tree.links.new(source, out.inputs["Surface"])
            tree.nodes.remove(stand_in)


def has_value(material):
    """Whether the background's value can scale the material: it has a colour, is not black and no glass."""
    node, socket = setter.colored(material)
    if node is None or node.type == "BSDF_GLASS":
        return False
    if node.type == "BSDF_PRINCIPLED" and (number(node, "Transmission Weight") or 0.0) >= 0.5:
        return False
    return socket.is_linked or max(color(socket)) > 0.0
