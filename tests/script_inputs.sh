# Creates the inputs of tests/limits.sh and tests/strace.sh, which source this file. A script must set `program` to the path of
# the program. The current folder must contain a folder `in`.

. "$(dirname "${BASH_SOURCE[0]}")/../.ci/skip.sh"

# quiet ARGUMENTS: creates an input with the program. If this fails, the script exits, because the checks need every input.
quiet() {
    "$program" "$@" >/dev/null 2>>log && return
    echo "input failed: $*" >&2
    tail -2 log >&2
    exit 1
}

small="--width 32 --height 24"
tiny="--scene-preset tiny --sequences 2 --images-per-scene 3 --label-every 2 $small"

# Creates images, a recording set, a data set and a plan with finished shards.
make_inputs() {
    command -v python3 >/dev/null || { missing python3 "the inputs of this script"; exit 0; }
python3 - <<'PY'
import struct, zlib
def png(name, level):
    raw = b"".join(b"\0" + bytes([level] * 8) for _ in range(8))
    chunk = lambda k, d: struct.pack(">I", len(d)) + k + d + struct.pack(">I", zlib.crc32(k + d))
    open(name, "wb").write(b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", struct.pack(">IIBBBBB", 8, 8, 8, 0, 0, 0, 0))
                           + chunk(b"IDAT", zlib.compress(raw)) + chunk(b"IEND", b""))
for i, level in enumerate([0, 80, 160]):
    png(f"in/p{i}.png", level)
text = "width = 8\nheight = 8\nreadout_hz = 20000\n"
for i, light in enumerate([0.0, 0.31, 0.63]):
    text += f'[[recording]]\nfile = "r{i}.dat"\nlight = {light}\n'
open("in/set.toml", "w").write(text)
PY
    local i
    for i in 0 1 2; do
        quiet simulate in/p$i.png --transfer linear --width 8 --height 8 --readouts 1100 -o in/r$i
    done
    quiet dataset plan $tiny -o in/merge --sequences-per-shard 1
    quiet dataset run in/merge --shards all
    quiet dataset $tiny -o in/whole
}
