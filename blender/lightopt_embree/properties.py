"""What the user chooses: in the preferences, of a scene, and of a lamp."""

import os

import bpy
from bpy.props import (BoolProperty, CollectionProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty,
                       StringProperty)

from . import results


class LightoptPreferences(bpy.types.AddonPreferences):
    bl_idname = __package__

    program: StringProperty(
        name="Program", subtype="FILE_PATH",
        description="Path of lightopt-embree; empty: that on PATH, or beside the add-on")

    def draw(self, context):
        self.layout.prop(self, "program")


class LightoptLine(bpy.types.PropertyGroup):
    """A line to the user."""

    text: StringProperty()


def is_lamp(_, ob):
    return ob.type == "LIGHT"


class LightoptLamp(bpy.types.PropertyGroup):
    lock: BoolProperty(name="Lock", description="Leave this lamp as it is")
    leader: PointerProperty(
        name="Ratio to", type=bpy.types.Object, poll=is_lamp,
        description="The lamp by whose light on the main object that of this one is told")
    stops: FloatProperty(
        name="Stops", default=-1.0, min=-12.0, max=12.0,
        description="Light that this lamp brings to the main object, in stops from that of the other")


def lights_found(self, context):
    # Blender keeps no strings of a dynamic list: they are kept here.
    lights_found.items = [(n, label, n) for n, label in results.choices(os.path.join(self.folder_path(), "run"))]
    return lights_found.items or [("lights.toml", "Best", "")]


class LightoptScene(bpy.types.PropertyGroup):
    look: EnumProperty(name="Look", items=[
        ("high-key", "High-key", "Bright, soft, low contrast"),
        ("low-key", "Low-key", "Dark, contrasted, black background"),
        ("TARGET", "Own target", "A look in numbers: a target file, or LIBRARY.toml#CLASS"),
        ("PHOTO", "Photograph", "Like a photograph")])
    target: StringProperty(name="File", subtype="FILE_PATH", description="Target file or photograph")
    main: PointerProperty(
        name="Main object", type=bpy.types.Collection, description="Its collection; empty: what is selected")
    power: BoolProperty(name="Power", default=True)
    size: BoolProperty(name="Size", default=True)
    color: BoolProperty(name="Colour", description="If the program can: its colour temperature")
    position: BoolProperty(name="Position", description="Area lamps and spots go around the main object")
    background: BoolProperty(name="Background", default=True, description="Brightness of what is behind it")
    exposure: BoolProperty(name="Exposure")
    lamps: IntProperty(name="Place lamps", min=0, max=12,
                       description="Lamps at most that are placed in the place of the scene's own; 0 keeps these")
    lock_world: BoolProperty(name="Lock the world")
    folder: StringProperty(name="Folder", subtype="DIR_PATH",
                           description="Where scene and results are kept; empty: beside the .blend file")
    chosen: EnumProperty(name="Lights", items=lights_found)
    more: StringProperty(name="Options", description="Further options of `lightopt-embree run`")
    lost: CollectionProperty(type=LightoptLine)
    said: StringProperty()

    def folder_path(self):
        """The folder of this scene's results."""
        if self.folder:
            return bpy.path.abspath(self.folder)
        base = os.path.dirname(bpy.data.filepath) if bpy.data.filepath else bpy.app.tempdir
        name = os.path.splitext(os.path.basename(bpy.data.filepath))[0] or "untitled"
        return os.path.join(base, f"lightopt_{name}")


CLASSES = (LightoptPreferences, LightoptLine, LightoptLamp, LightoptScene)


def attach():
    bpy.types.Scene.lightopt = PointerProperty(type=LightoptScene)
    bpy.types.Object.lightopt = PointerProperty(type=LightoptLamp)


def detach():
    del bpy.types.Object.lightopt
    del bpy.types.Scene.lightopt
