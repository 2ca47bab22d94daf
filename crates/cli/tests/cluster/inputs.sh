#!/usr/bin/env bash
# Measures the memory and the duration of `dataset` commands for many tiny inputs: planning, one shard, and a rerun of a finished
# shard. With `all` as third argument, also measures all shards and merging.
#   crates/cli/tests/cluster/inputs.sh [PROGRAM [INPUTS [all]]] > crates/cli/tests/cluster/inputs.txt
set -euo pipefail
program=$(realpath "${1:-target/debug/spikelane}")
inputs=${2:-100000}
place=$(mktemp -d "${TMPDIR:-/tmp}/spikelane-inputs.XXXXXX")
trap 'rm -rf "$place"' EXIT
python3 - "$place" "$inputs" <<'PY'
import sys
from pathlib import Path

place, inputs = Path(sys.argv[1]), int(sys.argv[2])
frame = b"FRAME\n" + bytes(range(64))
for i in range(inputs):
    folder = place / "clips" / f"{i // 1000:04}"
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"{i:07}.y4m").write_bytes(b"YUV4MPEG2 W8 H8 F25:1 Ip A1:1 Cmono\n" + frame)
PY
measured() { # NAME COMMAND...: prints the duration and the peak memory of a command
    local name=$1; shift
    python3 - "$name" "$@" <<'PY'
import resource
import subprocess
import sys
import time

begun = time.time()
subprocess.run(sys.argv[2:], check=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
memory = resource.getrusage(resource.RUSAGE_CHILDREN).ru_maxrss / 1024
print(f"{sys.argv[1]:<28}{time.time() - begun:>9.2f} s{memory:>9.0f} MB")
PY
}
shard=$((inputs / 100))
flags="--width 8 --height 8 --readouts-per-frame 1 --interpolation hold"
echo "date                        $(date -u +%Y-%m-%d)"
echo "inputs                      $inputs of 8x8 pixels, one frame each, $shard a shard"
mkdir -p "$place/some"
find "$place/clips" -name '*.y4m' | sort >"$place/some/all.txt"
for part in 100 10 1; do
    head -n $((inputs / part)) "$place/some/all.txt" >"$place/some/list.txt"
    measured "plan from a list of $((inputs / part))" "$program" dataset plan --from-list "$place/some/list.txt" $flags \
        -o "$place/list-$part" --sequences-per-shard "$shard"
done
measured "plan from a folder" "$program" dataset plan --from "$place/clips" $flags -o "$place/set" --sequences-per-shard "$shard"
measured "one shard, first" "$program" dataset run "$place/set" --shards 0
measured "one shard, nothing to do" "$program" dataset run "$place/set" --shards 0
measured "one shard, digests" "$program" dataset run "$place/set" --shards 0 --verify
measured "status" "$program" dataset status "$place/set"
if [ "${3:-}" = all ]; then
    measured "all shards" "$program" dataset run "$place/set" --shards all
    measured "all shards, nothing to do" "$program" dataset run "$place/set" --shards all
    measured "merge --no-verify --no-links" "$program" dataset merge "$place/set" --no-verify --no-links
    measured "merge --no-links" "$program" dataset merge "$place/set" --no-links
fi
