#!/usr/bin/env python3
"""Packs the add-on as an extension of Blender: `python3 blender/make.py -o lightopt_embree.zip`.

With `--program DIR` the program and its libraries, which lie in DIR, go along in `bin`, so that nothing else has to
be installed. Equal content gives equal bytes. In Blender: Preferences, Get Extensions, Install from Disk; or
`blender --command extension install-file -r user_default -e lightopt_embree.zip`.
"""

import argparse
import zipfile
from pathlib import Path

HERE = Path(__file__).resolve().parent / "lightopt_embree"
# The oldest time that a zip has.
WHEN = (1980, 1, 1, 0, 0, 0)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("-o", "--output", type=Path, default=Path("lightopt_embree.zip"))
    parser.add_argument("--program", type=Path, metavar="DIR", help="directory whose files go along in `bin`")
    args = parser.parse_args()
    files = [(p.name, p) for p in sorted(HERE.iterdir()) if p.suffix in {".py", ".toml"}]
    if args.program:
        files += [(f"bin/{p.name}", p) for p in sorted(args.program.iterdir()) if p.is_file()]
    args.output.parent.mkdir(parents=True, exist_ok=True)
    aside = args.output.with_suffix(".tmp")
    with zipfile.ZipFile(aside, "w", zipfile.ZIP_DEFLATED) as out:
        for name, path in files:
            data = path.read_bytes()
            if name == "blender_manifest.toml" and args.program:
                data = data.replace(b'type = "add-on"\n', b'type = "add-on"\nplatforms = ["linux-x64"]\n')
            info = zipfile.ZipInfo(name, WHEN)
            info.compress_type, info.external_attr = zipfile.ZIP_DEFLATED, (path.stat().st_mode & 0o777) << 16
            out.writestr(info, data)
    aside.replace(args.output)
    print(f"wrote {args.output}")


if __name__ == "__main__":
    main()
