#!/bin/sh
# Installs what the build needs on Debian 12 or 13; does nothing when all of it is there.
set -eu
cd "$(dirname "$0")"

# cmake, make and g++ build NLopt (C, but its CMake project asks for a C++ compiler too),
# libclang reads the header of the C shim, git stamps the commit.
missing=
for package in ca-certificates cmake g++ gcc git libclang-dev libembree-dev make; do
  status=$(dpkg-query --show --showformat '${db:Status-Status}' "$package" 2>/dev/null) || true
  [ "$status" = installed ] || missing="$missing $package"
done
if [ -n "$missing" ]; then
  if [ "$(id -u)" = 0 ]; then sudo=; else sudo=sudo; fi
  $sudo apt-get update
  # shellcheck disable=SC2086 # a list of words
  $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends $missing
fi

need=$(sed -n 's/^rust-version = "\(.*\)"/\1/p' Cargo.toml)
have=$(cargo --version 2>/dev/null | cut -d ' ' -f 2)
if [ "$(printf '%s\n' "$need" "${have:-0}" | sort -V | sed -n 1p)" != "$need" ]; then
  echo "setup.sh: cargo $need or newer is needed (found: ${have:-none}); install it from https://rustup.rs" >&2
  exit 1
fi
