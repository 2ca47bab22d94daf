#!/usr/bin/env bash
# Counts with strace the file system operations per sequence. The difference between shards of three sequences and of one sequence
# excludes the operations of the shard itself. Sequences with few and with many files F determine the operations per file.
#   crates/cli/tests/cluster/operations.sh [PROGRAM] > crates/cli/tests/cluster/operations.txt
set -euo pipefail
program=$(realpath "${1:-target/debug/spikelane}")
command -v strace >/dev/null || { echo "operations.sh: needs strace" >&2; exit 2; }
place=$(mktemp -d "${TMPDIR:-/tmp}/spikelane-operations.XXXXXX")
trap 'rm -rf "$place"' EXIT
calls=openat,statx,newfstatat,rename,renameat2,unlink,unlinkat,fsync,mkdir,rmdir,getdents64,link,ftruncate
echo "date      $(date -u +%Y-%m-%d)"
for pack in "" --pack; do
    points=()
    for images in 3 43; do
        counts=()
        for sequences in 1 3; do
            set=$place/$images-$sequences$pack
            "$program" dataset plan --scene-preset tiny --sequences "$sequences" --images-per-scene "$images" --label-every 0 --width 32 \
                --height 24 -o "$set" --sequences-per-shard "$sequences" $pack >/dev/null
            strace -f -c -e "trace=$calls" -o "$place/counts" "$program" dataset run "$set" --shards 0 --threads 1 >/dev/null 2>&1
            counts+=("$(awk '$NF == "total" {print $4}' "$place/counts")")
        done
        # The files of a sequence are its images, two streams, a sidecar, a reference image, the ground truth and the record.
        points+=("$((images + 6)) $(((counts[1] - counts[0]) / 2))")
    done
    printf '%s\n' "${points[@]}" | awk -v pack="${pack:-folders}" '
        {f[NR] = $1; n[NR] = $2}
        END {slope = (n[2] - n[1]) / (f[2] - f[1]); printf "%-9s F = %d: %d, F = %d: %d; %.1f F + %.0f\n", pack, f[1], n[1], f[2], n[2], slope, n[1] - slope * f[1]}'
done
