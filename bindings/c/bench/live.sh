#!/usr/bin/env bash
# live.sh PROGRAM [SECONDS [CORE]]: measures `PROGRAM live` with full noise on one core and prints a table. The light is constant
# or changes every 20 readouts. Measures every instruction set at 20 kHz, AVX-512 also at 40 kHz, and a slow consumer.
set -euo pipefail
program=$(realpath "${1:?usage: live.sh PROGRAM [SECONDS [CORE]]}")
seconds=${2:-60}
core=${3:-0}
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
cd "$folder"
# Writes an image of 400x250 pixels with a horizontal gray ramp.
{ printf 'P5\n400 250\n255\n'; for _ in $(seq 250); do printf '%b' "$(for c in $(seq 0 399); do printf '\\x%02x' $((c * 255 / 399)); done)"; done; } >ramp.pgm

# row LABEL HZ BACKEND ARGUMENTS...: measures one row of the table.
row() {
    local what=$1 hz=$2 backend=$3
    shift 3
    taskset -c "$core" "$program" --json live "$@" --readout-hz "$hz" --backend "$backend" --threads 1 \
        --readouts $((hz * seconds)) >events 2>/dev/null || { echo "| $what | $hz | $backend | not on this CPU | | | | | |"; return; }
    grep '"event":"live"' events | python3 -c '
import json, sys
e = json.loads(sys.stdin.read())
late = [format(e["lateness_ms"][key], ".2f") for key in ("median", "p99", "p99_9", "max")]
print("|", " | ".join([*sys.argv[1:], format(e["readouts_per_second"], ".0f"), str(e["dropped"]), *late]), "|")
' "$what" "$hz" "$backend"
}

echo "\`bindings/c/bench/live.sh spikelane $seconds $core\`, $(date -u +%F), $(sed -n 's/^model name.*: //p' /proc/cpuinfo | head -1)," \
    "load $(cut -d' ' -f1 /proc/loadavg) on $(nproc) cores when it began; one core, 400x250, camera physical, into a ring."
echo
echo "| light | Hz | instructions | readouts/s | dropped | median ms | 99 % | 99.9 % | max |"
echo "|---|---|---|---|---|---|---|---|---|"
ring="shm:spikelane-bench-$$"
for hz in 20000 40000; do
    for backend in avx512 avx2 sse4.1 portable; do
        [ "$hz" = 40000 ] || [ "$backend" = avx512 ] || continue
        row held "$hz" "$backend" ramp.pgm --transfer linear --sink "$ring"
        row "new frame every 20 readouts" "$hz" "$backend" --builtin-light chart --readouts-per-frame 20 --sink "$ring"
    done
done
# `live` writes 250 MB per second, and this consumer reads only 100 MB per second.
for policy in drop block; do
    mkfifo slow
    python3 -c '
import time
with open("slow", "rb", buffering=0) as pipe:
    start, received = time.monotonic(), 0
    while chunk := pipe.read(1 << 16):
        received += len(chunk)
        time.sleep(max(0.0, received / 100e6 - (time.monotonic() - start)))
' &
    row "held, a consumer of 100 MB/s, --$policy" 20000 auto ramp.pgm --transfer linear --sink pipe:slow --"$policy"
    wait
    rm slow
done
