"""What the buttons do."""

import json
import os
import shlex

import bpy

from . import export, lamps, program, results

# The run at work, or None; asked by a timer, so that Blender stays usable.
RUN = {"run": None, "scene": None}
SECONDS = 0.5


def preferred(context):
    addon = context.preferences.addons.get(__package__)
    return bpy.path.abspath(addon.preferences.program) if addon and addon.preferences.program else ""


def wishes(scene, lights):
    """The words of --lock and --ratio that the lamps' settings are, by the names in the sidecar."""
    names = {entry["object"]: name for name, entry in lights.items() if "object" in entry}
    locks, ratios = [], []
    for object_name, name in names.items():
        settings = bpy.data.objects[object_name].lightopt
        if settings.lock:
            locks.append(name)
        elif settings.leader and settings.leader.name in names and settings.leader.name != object_name:
            ratios.append(f"{name}={names[settings.leader.name]}*{2.0 ** settings.stops:.6g}")
    locks += [name for name, entry in lights.items() if entry.get("world") and scene.lightopt.lock_world]
    return locks, ratios


def words(context, path, folder):
    """The command line for a scene that is written. Raises ValueError with one line."""
    s = context.scene.lightopt
    look = s.look
    if look in {"TARGET", "PHOTO"}:
        look = bpy.path.abspath(s.target)
        if not os.path.isfile(look.split("#")[0]):
            raise ValueError(f"{look or 'the look'}: no such file")
    free = [word for word, chosen in (("radiance", s.power), ("size", s.size), ("background", s.background),
                                      ("exposure", s.exposure)) if chosen]
    if s.color:
        if not program.offers(path, "color"):
            raise ValueError("this version of the program does not vary the colour of lights")
        free.append("color")
    if not free:
        raise ValueError("choose what may vary")
    with open(os.path.join(folder, export.LAMPS), encoding="utf-8") as file:
        lights = json.load(file)["lights"]
    locks, ratios = wishes(context.scene, lights)
    if s.lamps:  # They replace the scene's own.
        locks, ratios = [], []
    return program.command(path, os.path.join(folder, export.SCENE), os.path.join(folder, "run"), look, free, locks,
                           ratios, s.lamps, s.position and not s.lamps, shlex.split(s.more))


def tick():
    """Shows the progress of the run, and ends with it."""
    run, scene = RUN["run"], RUN["scene"]
    if run is None:
        return None
    try:
        s = scene.lightopt
    except ReferenceError:  # Another file was opened.
        stop()
        return None
    s.said = run.says()
    if run.is_done():
        status = run.wait()
        folder = os.path.join(s.folder_path(), "run")
        if status == 0 or (status == 130 and os.path.isfile(os.path.join(folder, "lights.toml"))):
            s.said = "found" if status == 0 else "cancelled; what was found is kept"
        else:
            s.said = f"failed: {run.says()}"
        RUN["run"] = None
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "PROPERTIES":
                area.tag_redraw()
    return SECONDS if RUN["run"] else None


def stop():
    """Ends a run that is at work."""
    if RUN["run"]:
        RUN["run"].cancel()
        RUN["run"] = None


class Operator(bpy.types.Operator):
    """An operator whose errors are lines to the user."""

    def execute(self, context):
        try:
            return self.work(context) or {"FINISHED"}
        except (ValueError, OSError) as error:
            context.scene.lightopt.said = str(error)
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}


class LIGHTOPT_OT_check(Operator):
    bl_idname, bl_label = "lightopt.check", "What Is Not Carried"
    bl_description = "Write the scene for the program, and list what it will not see"

    def work(self, context):
        s = context.scene.lightopt
        lost = export.write(context, s.folder_path(), s.main)
        s.lost.clear()
        for line in lost:
            s.lost.add().text = line
        s.said = f"{len(lost)} not carried" if lost else "all is carried"


class LIGHTOPT_OT_find(Operator):
    bl_idname, bl_label = "lightopt.find", "Find Lights"
    bl_description = "Find the lights for the look, in the background"

    @classmethod
    def poll(cls, context):
        return RUN["run"] is None

    def invoke(self, context, event):
        try:
            program.check(program.find(preferred(context)))
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        bpy.ops.lightopt.check()
        if context.scene.lightopt.lost:
            return context.window_manager.invoke_props_dialog(self, width=500, title="These are not carried")
        return self.execute(context)

    def draw(self, context):
        for line in context.scene.lightopt.lost:
            self.layout.label(text=line.text)

    def work(self, context):
        s = context.scene.lightopt
        path = program.find(preferred(context))
        program.check(path)
        folder = s.folder_path()
        lost = export.write(context, folder, s.main)
        s.lost.clear()
        for line in lost:
            s.lost.add().text = line
        RUN["run"] = program.Run(words(context, path, folder), os.path.join(folder, "run.log"))
        RUN["scene"] = context.scene
        s.said = "starting"
        bpy.app.timers.register(tick, first_interval=SECONDS)


class LIGHTOPT_OT_cancel(Operator):
    bl_idname, bl_label = "lightopt.cancel", "Cancel"
    bl_description = "End the search within two seconds; what was found is kept"

    @classmethod
    def poll(cls, context):
        return RUN["run"] is not None

    def work(self, context):
        RUN["run"].cancel()


class LIGHTOPT_OT_apply(Operator):
    bl_idname, bl_label = "lightopt.apply", "Apply"
    bl_description = "Set the lights that were found"
    bl_options = {"REGISTER", "UNDO"}

    lights: bpy.props.StringProperty(description="File of lights in the run's folder; empty: the chosen one")

    def work(self, context):
        s = context.scene.lightopt
        run = os.path.join(s.folder_path(), "run")
        by_hand = results.apply(context.scene, s.folder_path(), os.path.join(run, self.lights or s.chosen or "lights.toml"))
        for line in by_hand:
            self.report({"WARNING"}, line)
        s.said = "; ".join(by_hand) or "applied"


class LIGHTOPT_OT_back(Operator):
    bl_idname, bl_label = "lightopt.back", "Back"
    bl_description = "Set the lights as they were before they were found"
    bl_options = {"REGISTER", "UNDO"}

    def work(self, context):
        context.scene.lightopt.said = "as before" if results.back(context.scene) else "nothing was applied"


class LIGHTOPT_OT_known_view(Operator):
    bl_idname, bl_label = "lightopt.known_view", "Set a Known View"
    bl_description = (
        "Keep the view transform where the program knows it (AgX, Filmic, Standard, Khronos PBR Neutral, Raw), else set "
        "Standard; without a look and with a gamma of 1"
    )
    bl_options = {"REGISTER", "UNDO"}

    def work(self, context):
        view = context.scene.view_settings
        if view.view_transform not in lamps.VIEWS:
            view.view_transform = "Standard"
        view.look, view.gamma = "None", 1.0


class LIGHTOPT_OT_open(Operator):
    bl_idname, bl_label = "lightopt.open", "Open"
    bl_description = "Open a file of the run"

    file: bpy.props.StringProperty()

    def work(self, context):
        bpy.ops.wm.path_open(filepath=os.path.join(context.scene.lightopt.folder_path(), "run", self.file))


CLASSES = (LIGHTOPT_OT_check, LIGHTOPT_OT_find, LIGHTOPT_OT_cancel, LIGHTOPT_OT_apply, LIGHTOPT_OT_back,
           LIGHTOPT_OT_known_view, LIGHTOPT_OT_open)
