#!/usr/bin/env bash
# Tries an archive of dist/make.sh in bare Debian roots, without development packages, as root:
#
#     dist/try.sh ARCHIVE.tar.gz [SUITE…]        # default: bookworm trixie
#
# In each the program finds the lights of a small room.
set -euo pipefail
archive=$(readlink -f "$1")
shift
[ $# -gt 0 ] || set -- bookworm trixie
work=$(mktemp -d)
clean() {
  for root in "$work"/*/; do
    mountpoint -q "$root/proc" && umount "$root/proc"
  done
  rm -rf --one-file-system "$work"
}
trap clean EXIT
for suite; do
  root=$work/$suite
  debootstrap --variant=minbase "$suite" "$root" >"$work/$suite.log"
  tar -C "$root/opt" -xzf "$archive"
  # The run path begins at the program, which the loader asks of /proc.
  mount -t proc proc "$root/proc"
  mkdir "$root/room"
  printf 'v -1 0 -1\nv 1 0 -1\nv 1 0 1\nv -1 0 1\nv -.3 0 0\nv .3 0 0\nv 0 .8 0\no floor\nf 4 3 2 1\no sail\nf 5 6 7\n' \
    >"$root/room/room.obj"
  chroot "$root" sh -c 'cd /room && /opt/lightopt-embree-*/lightopt-embree run --size 64x48 --work-size 32x24 \
    --final-spp 8 room.obj && test -s runs/room-high-key/lights.toml && ldd /opt/lightopt-embree-*/lightopt-embree'
  echo "$suite: runs"
done
