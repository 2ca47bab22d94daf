#!/usr/bin/env bash
# Tests data sets on a file system without hard links: exFAT (through FUSE) on a loop device. Generates, reruns and merges shards,
# packed and unpacked. Folders for loaders contain copies. Needs root, and Debian's exfat-fuse and exfatprogs.
#   crates/cli/tests/cluster/no-links.sh [PROGRAM] > crates/cli/tests/cluster/no-links.txt
set -euo pipefail
program=$(realpath "${1:-target/debug/spikelane}")
place=$(mktemp -d /tmp/spikelane-exfat.XXXXXX)
loop=
cleanup() {
    if mountpoint -q "$place/disk"; then umount "$place/disk"; fi
    [ -z "$loop" ] || losetup -d "$loop"
    rm -rf "$place"
}
trap cleanup EXIT
truncate -s 64M "$place/image"
mkfs.exfat "$place/image" >/dev/null || { echo "no-links.sh: needs exfatprogs" >&2; exit 2; }
mkdir "$place/disk"
loop=$(losetup -f --show "$place/image")
mounted() { mount.exfat-fuse "$loop" "$place/disk" >/dev/null 2>&1; }
mounted || { echo "no-links.sh: needs exfat-fuse and FUSE" >&2; exit 2; }
touch "$place/disk/a"
if ln "$place/disk/a" "$place/disk/b" 2>/dev/null; then echo "no-links.sh: this file system has links" >&2; exit 2; fi
scenes="--scene-preset tiny --sequences 3 --images-per-scene 3 --label-every 2 --width 32 --height 24"
echo "date       $(date -u +%Y-%m-%d)"
one=$("$program" dataset $scenes -o "$place/one" 2>/dev/null | sed -n 's/^digest //p')
echo "elsewhere  $one"
for pack in "" --pack; do
    set="$place/disk/set$pack"
    "$program" dataset plan $scenes -o "$set" --sequences-per-shard 2 $pack >/dev/null
    "$program" dataset run "$set" --shards all >/dev/null
    # exFAT rounds file times. The rounded times after a remount must not cause a rerun to generate sequences again.
    umount "$place/disk" && sleep 1 && mounted
    "$program" dataset run "$set" --shards all
    "$program" dataset merge "$set" 2>&1 | sed "s|$place/disk/||" | tee "$place/merged.txt"
    grep -q "$one" "$place/merged.txt" || { echo DIFFERENT; exit 1; }
done
