"""Lightopt: finds the lights for a look, by the program lightopt-embree."""

import bpy

from . import operators, panel, properties

MODULES = (properties, operators, panel)


def register():
    for module in MODULES:
        for cls in module.CLASSES:
            bpy.utils.register_class(cls)
    properties.attach()


def unregister():
    operators.stop()
    panel.forget()
    properties.detach()
    for module in reversed(MODULES):
        for cls in reversed(module.CLASSES):
            bpy.utils.unregister_class(cls)
