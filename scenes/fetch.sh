#!/bin/sh
# Fetches models from Debian's package sweethome3d-furniture (120 MB, kept out of the
# repository) and composes with the sidecars in scenes/fetch the scenes girl, creature and
# bowl in scenes/fetched. Does nothing when all is there; a sidecar that is there stays.
set -eu
cd "$(dirname "$0")"
package=sweethome3d-furniture
out=fetched
if [ "$(id -u)" = 0 ]; then sudo=; else sudo=sudo; fi

# scene, archive in the package, path of the OBJ in it, licence
scenes() {
  cat <<'LIST'
girl Reallusion reallusion/girlStanding/girlStanding.obj CC-BY-3.0-US https://creativecommons.org/licenses/by/3.0/us/
creature BlendSwap-CC-BY blendswap-cc-by/bulldog/bulldog.obj CC-BY-3.0 https://creativecommons.org/licenses/by/3.0/
bowl Scopia scopia/bowlWithFruits/bowlWithFruits.obj CC-BY-3.0 https://creativecommons.org/licenses/by/3.0/
LIST
}

is_complete() {
  [ -f "$out/CREDITS.md" ] || return 1
  for name in $(scenes | cut -d ' ' -f 1); do
    [ -f "$out/$name.obj" ] && [ -f "$out/$name.toml" ] || return 1
  done
}

install_tools() {
  command -v unzip >/dev/null && return
  $sudo apt-get update
  $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends unzip
}

# Unpacks the package into $1.
download() (
  cd "$1"
  apt-get download "$package" || {
    $sudo apt-get update
    apt-get download "$package"
  }
  dpkg-deb -x "$package"_*.deb .
)

# The value of a key of the model $2 in the catalogue $1: `key#n=value` with the n of the
# line that names the model.
catalogue() {
  awk -F = -v model="/$2" -v key="$3" '
    { split($1, at, "#"); value[at[1], at[2]] = substr($0, length($1) + 2) }
    $2 == model && $1 ~ /^model#/ { n = at[2] }
    END { print value[key, n] }' "$1"
}

# Composes scene $1 from model $3 of archive $2 of the licence $4 at $5, unpacked below $work.
compose() {
  archive="$work/usr/share/sweethome3d/furniture/$2.sh3f"
  folder=$(dirname "$3")
  unzip -q -o "$archive" "$folder/*" PluginFurnitureCatalog.properties -d "$work/$1"
  for image in "$work/$1/$folder"/*.jpg "$work/$1/$folder"/*.png; do
    if [ -f "$image" ]; then cp "$image" "$out/"; fi
  done
  cp "$work/$1/${3%.obj}.mtl" "$out/$1.mtl"
  [ -f "$out/$1.toml" ] || cp "fetch/$1.toml" "$out/$1.toml"
  # Last, for its presence says that all of the scene is there.
  awk -v mtl="$1.mtl" '$1 == "mtllib" { $0 = "mtllib " mtl } { print }' "$work/$1/$3" >"$work/$1.obj"
  mv "$work/$1.obj" "$out/$1.obj"
  properties="$work/$1/PluginFurnitureCatalog.properties"
  title=$(catalogue "$properties" "$3" name)
  author=$(catalogue "$properties" "$3" creator)
  printf -- '- `%s.obj`: "%s" by %s, [%s](%s), `%s` in `%s.sh3f`\n' "$1" "$title" "$author" "$4" "$5" "$3" "$2" \
    >>"$work/credits"
}

if is_complete; then exit 0; fi
install_tools
mkdir -p "$out"
work=$(mktemp -d "$out/.fetch.XXXXXX")
trap 'rm -rf "$work"' EXIT
trap 'exit 1' HUP INT TERM
download "$work"
cat >"$work/credits" <<LIST
# Credits

Models of Debian's package $package, which has them from Sweet Home 3D
(<http://www.sweethome3d.com/importModels.jsp>); the package's copyright file is beside
this one. Only the name of the material library in each OBJ was changed; lights, camera,
backdrop and some materials are set by the sidecars.

LIST
scenes | while read -r name archive model licence address; do
  compose "$name" "$archive" "$model" "$licence" "$address"
done
cp "$work/usr/share/doc/$package/copyright" "$out/copyright"
mv "$work/credits" "$out/CREDITS.md"
chmod 644 "$out"/*
echo "scenes/fetched: $(scenes | cut -d ' ' -f 1 | tr '\n' ' ')"
