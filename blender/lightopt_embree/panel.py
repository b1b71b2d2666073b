"""The panel in the render tab."""

import os

import bpy
import bpy.utils.previews

from . import lamps, operators

SHEET, REPORT = "contact.png", "report.html"
# Height of a contact sheet in the panel, lines of text.
SHEET_LINES = 10.0
PREVIEWS = {}


def preview(path):
    """Icon of a picture, loaded anew where the file has changed; 0 where there is none."""
    if not os.path.isfile(path):
        return 0
    if "all" not in PREVIEWS:
        PREVIEWS["all"] = bpy.utils.previews.new()
    key = f"{path} {os.path.getmtime(path)}"
    if key not in PREVIEWS["all"]:
        PREVIEWS["all"].load(key, path, "IMAGE")
    return PREVIEWS["all"][key].icon_id


def forget():
    """Frees all previews."""
    if "all" in PREVIEWS:
        bpy.utils.previews.remove(PREVIEWS.pop("all"))


class LIGHTOPT_PT_panel(bpy.types.Panel):
    bl_label = "Lightopt"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        s, layout = context.scene.lightopt, self.layout
        layout.use_property_split = True
        layout.prop(s, "look")
        if s.look in {"TARGET", "PHOTO"}:
            layout.prop(s, "target")
        layout.prop(s, "main")
        if s.main is None:
            n = sum(o.type not in {"LIGHT", "CAMERA"} for o in context.selected_objects)
            layout.label(text=f"Main object: the selection, {n} object{'s' if n != 1 else ''}")
        view = context.scene.view_settings
        is_known = view.view_transform in lamps.VIEWS
        if not is_known or view.look not in {"None", ""}:
            row = layout.row()
            row.alert = True
            what = f"The look {view.look}" if is_known else f"The view {view.view_transform}"
            row.label(text=f"{what} is not known to the program", icon="ERROR")
            row.operator("lightopt.known_view")
        column = layout.column(heading="May vary")
        for name in ("power", "size", "color", "position", "background", "exposure"):
            column.prop(s, name)
        layout.prop(s, "lamps")
        self.found(s, layout)

    def found(self, s, layout):
        """Buttons and results."""
        if operators.RUN["run"]:
            layout.label(text=s.said)
            layout.operator("lightopt.cancel", icon="CANCEL")
            return
        row = layout.row(align=True)
        row.operator("lightopt.find", icon="OUTLINER_OB_LIGHT")
        row.operator("lightopt.check", text="", icon="INFO")
        if s.said:
            layout.label(text=s.said)
        run = os.path.join(s.folder_path(), "run")
        if not os.path.isfile(os.path.join(run, "lights.toml")):
            return
        icon = preview(os.path.join(run, SHEET))
        if icon:
            layout.template_icon(icon_value=icon, scale=SHEET_LINES)
        layout.prop(s, "chosen")
        row = layout.row(align=True)
        row.operator("lightopt.apply", icon="CHECKMARK").lights = s.chosen
        row.operator("lightopt.back", icon="LOOP_BACK")
        row = layout.row(align=True)
        for file, text in ((SHEET, "Contact Sheet"), (REPORT, "Report"), ("final.png", "Picture")):
            if os.path.isfile(os.path.join(run, file)):
                row.operator("lightopt.open", text=text).file = file


class LIGHTOPT_PT_lamps(bpy.types.Panel):
    bl_label, bl_parent_id = "Lamps", "LIGHTOPT_PT_panel"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        layout = self.layout
        for ob in context.scene.objects:
            if ob.type != "LIGHT" or ob.hide_render:
                continue
            row = layout.row(align=True)
            row.prop(ob.lightopt, "lock", text="", icon="LOCKED" if ob.lightopt.lock else "UNLOCKED")
            row.label(text=ob.name)
            row.prop(ob.lightopt, "leader", text="")
            if ob.lightopt.leader:
                row.prop(ob.lightopt, "stops", text="")
        layout.prop(context.scene.lightopt, "lock_world")


class LIGHTOPT_PT_lost(bpy.types.Panel):
    bl_label, bl_parent_id = "Not Carried", "LIGHTOPT_PT_panel"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "render"

    @classmethod
    def poll(cls, context):
        return bool(context.scene.lightopt.lost)

    def draw(self, context):
        for line in context.scene.lightopt.lost:
            self.layout.label(text=line.text)


class LIGHTOPT_PT_files(bpy.types.Panel):
    bl_label, bl_parent_id = "Files", "LIGHTOPT_PT_panel"
    bl_space_type, bl_region_type, bl_context = "PROPERTIES", "WINDOW", "render"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.prop(context.scene.lightopt, "folder")
        self.layout.prop(context.scene.lightopt, "more")


CLASSES = (LIGHTOPT_PT_panel, LIGHTOPT_PT_lamps, LIGHTOPT_PT_lost, LIGHTOPT_PT_files)
