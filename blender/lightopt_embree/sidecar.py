"""Writing of TOML: tables of strings, numbers, truth values and lists of these."""

import json
import math


def value(v):
    """A value as TOML has it."""
    if isinstance(v, bool):
        return "true" if v else "false"
    if isinstance(v, str):
        return json.dumps(v)  # A basic string of TOML has the escapes of JSON.
    if isinstance(v, int):
        return str(v)
    if isinstance(v, float):
        if not math.isfinite(v):
            raise ValueError(f"a sidecar has no {v}")
        return repr(v)
    return "[" + ", ".join(value(x) for x in v) + "]"


def key(k):
    """A key, quoted where it must be."""
    plain = k and all(c.isascii() and (c.isalnum() or c in "_-") for c in k)
    return k if plain else json.dumps(k)


def table(name, content):
    """The lines of a table; what is None is left out. `name` is ready to be written, as is `[[lights]]`."""
    lines = [f"{key(k)} = {value(v)}" for k, v in content.items() if v is not None]
    return "\n".join(([name] if name else []) + lines) + "\n\n"


def text(top, camera, main, background, lights, materials, ties):
    """The text of a sidecar."""
    parts = [table("", {"schema": 1, **top}), table("[camera]", camera), table("[main_object]", main)]
    if background:
        parts.append(table("[background]", background))
    if ties:
        parts.append(table("[ties]", ties))
    parts += [table("[[lights]]", light) for light in lights]
    parts += [table(f"[materials.{key(name)}]", content) for name, content in materials.items()]
    return "".join(parts)
