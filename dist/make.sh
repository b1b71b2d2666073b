#!/usr/bin/env bash
# Builds a relocatable archive of the program for systems without a compiler:
#
#     dist/make.sh [DIRECTORY]        # default: target/dist
#
# lightopt-embree-VERSION-linux-x86_64.tar.gz holds the program, Embree and TBB beside it (found by a run path that
# is relative to the program), their licences, the built-in scenes' targets, and Blender's add-on, whose zip holds
# the program once more, so that nothing else has to be installed. Built on Debian 12 it runs where the C library
# is 2.36 or newer. dist/try.sh tries it in bare Debian roots.
set -euo pipefail
cd "$(dirname "$0")/.."
out=${1:-target/dist}
version=$(sed -n 's/^version = "\(.*\)"/\1/p' Cargo.toml | head -n 1)
name=lightopt-embree-$version-linux-x86_64

# The run path serves the libraries' own libraries too, which needs its old form. Only the program is linked anew.
cargo rustc --locked --release --bin lightopt-embree -- \
  -C link-arg=-Wl,-rpath,'$ORIGIN/lib:$ORIGIN',--disable-new-dtags -C strip=debuginfo
program=${CARGO_TARGET_DIR:-target}/release/lightopt-embree

root=$out/$name
rm -rf "$root"
mkdir -p "$root/lib" "$root/licences"
cp "$program" "$root/"
for library in libembree libtbb; do
  path=$(ldd "$program" | sed -n "s/.*=> \(.*$library[^ ]*\) .*/\1/p")
  cp -L "$path" "$root/lib/$(basename "$path")"
  package=$(dpkg -S "$(readlink -f "$path")" | cut -d: -f1)
  cp "/usr/share/doc/$package/copyright" "$root/licences/$package.txt"
done
cp LICENSE "$root/licences/lightopt-embree.txt"
# What is linked statically and is under other licences than ours.
sources=$(cargo metadata --locked --format-version 1 | python3 -c 'import json, os, sys
for p in json.load(sys.stdin)["packages"]:
    if p["name"] in ("nlopt", "dejavu"):
        print(os.path.dirname(p["manifest_path"]))')
for source in $sources; do
  find "$source" \( -name 'COPY*' -o -name 'LICENSE*' \) -type f | sort | while read -r text; do
    printf '==== %s ====\n\n' "${text#"$source"/}"
    cat "$text"
    echo
  done >"$root/licences/$(basename "$source").txt"
done
cp -r scenes/targets "$root/targets"
cp README.md CHANGELOG.md "$root/"

# In the add-on all lie in one folder.
staged=$(mktemp -d)
trap 'rm -rf "$staged"' EXIT
cp "$root/lightopt-embree" "$root"/lib/* "$root"/licences/* "$staged/"
python3 blender/make.py -o "$root/lightopt_embree.zip" --program "$staged"

tar -C "$out" --sort=name --owner=0 --group=0 --mtime=@0 -czf "$out/$name.tar.gz" "$name"
echo "wrote $out/$name.tar.gz"
