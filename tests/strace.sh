#!/bin/bash
# Paths that commands open for writing, create, rename, link or remove, as strace sees them: each has to lie below the
# folder that the user named. Usage: tests/strace.sh [PROGRAM]
#   Prints a line for each command and ends with code 1 when a path lies elsewhere. Where strace is missing or may not
#   trace, it prints that and ends with code 0.
set -u
program=$(realpath "${1:-target/debug/spikelane}")
command -v strace >/dev/null || { echo "skipped: strace is not installed"; exit 0; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
strace -o "$work/probe" true 2>/dev/null || { echo "skipped: strace may not trace here"; exit 0; }
cd "$work" && mkdir in

# Inputs; none of this is traced.
small="--width 32 --height 24"
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
quiet() { "$program" "$@" >/dev/null 2>>"$work/log" || echo "input failed: $*"; }
for i in 0 1 2; do
    quiet simulate in/p$i.png --transfer linear --width 8 --height 8 --readouts 1100 -o in/r$i
done
quiet simulate --source chart $small --readouts 400 -o in/a
tiny="--kind tiny --sequences 2 --images 3 --label-every 2 $small"
for plan in run merge pack; do
    quiet dataset plan $tiny -o in/$plan --per-shard 1 $([ $plan = pack ] && echo --pack)
done
quiet dataset run in/merge --shard all
quiet dataset $tiny -o in/whole

calls=openat,open,creat,rename,renameat,renameat2,unlink,unlinkat,rmdir,mkdir,mkdirat,link,linkat,symlink,symlinkat,truncate,mknod,mknodat,chmod,fchmodat,chown,lchown,fchownat
failed=0
# check FOLDER LINE...: everything written lies below FOLDER.
check() {
    local folder=$1
    shift
    local trace="$work/trace"
    rm -f "$trace"
    strace -f -y -qq -s 4096 -e trace=$calls -e signal=none -o "$trace" "$program" "$@" >/dev/null 2>"$work/log"
    local code=$?
    local found
    found=$(python3 - "$trace" "$work" "$work/$folder" <<'PY'
import os, re, sys
trace, here, allowed = sys.argv[1:]
wrong, seen = set(), 0
for line in open(trace, errors="replace"):
    line = line.split(None, 1)[1] if line[:1].isdigit() else line
    call = line.split("(")[0]
    # A call that failed changed nothing; one that is unfinished counts.
    if re.search(r"= -1 E", line):
        continue
    if call in ("open", "openat") and not re.search(r"O_WRONLY|O_RDWR|O_CREAT|O_TRUNC", line):
        continue
    quoted = list(re.finditer(r'(?:(?:AT_FDCWD|\d+)<([^>]*)>, )?"((?:[^"\\]|\\.)*)"', line))
    # The first name of a link is only read: what is made is the second.
    if call.startswith("symlink") or call.startswith("link"):
        quoted = quoted[-1:]
    for match in quoted:
        base, name = match.group(1) or here, match.group(2)
        path = os.path.normpath(os.path.join(base, name))
        seen += 1
        if path == allowed or path.startswith(allowed + "/"):
            continue
        # Parents of the folder that the user named, which are made where they are missing.
        if call.startswith("mkdir") and allowed.startswith(path + "/"):
            continue
        # A sink and the terminal, which keep nothing.
        if path in ("/dev/null", "/dev/tty"):
            continue
        wrong.add(f"{call} {path}")
print(seen)
for w in sorted(wrong):
    print("   ", w)
PY
)
    local seen=${found%%$'\n'*}
    local wrong=${found#"$seen"}
    printf '%-60.60s code %d, %3d paths%s\n' "$*" $code "$seen" "${wrong:+, elsewhere:$wrong}"
    [ -z "$wrong" ] || failed=1
    # A command that failed early would show nothing.
    [ $code -eq 0 ] || { failed=1; tail -3 "$work/log"; }
}

check out/1 simulate --source chart $small --readouts 50 --clean --images-every 10 -o out/1/a
check out/1 simulate --source chart $small --readouts 50 --clean --images-every 10 -o out/1/a --force
check out/2 convert in/a.dat out/2/a.npy
check out/3 reconstruct in/a.dat -o out/3
check out/4 reconstruct in/a.dat -o out/4/a.png
check out/5 inspect in/a.dat --png out/5/a.png
check out/none verify in/a.dat
check out/6 measure in/a.dat --report out/6/a.html
check out/7 record --width 16 --height 12 --readouts 200 -o out/7
check out/8 calibrate in/set.toml -o out/8
check out/9 compare in/set.toml ideal --longest 50 -o out/9
check out/10 diagnose in/set.toml --camera physical --cache out/10/cache -o out/10
check out/11 scene --width 32 --height 24 -o out/11
check out/12 dataset $tiny -o out/12
check out/12 dataset $tiny -o out/12 --resume
check out/13 dataset plan $tiny -o out/13 --per-shard 1
check in/run dataset run in/run --shard all
check in/pack dataset run in/pack --shard all
check in/merge dataset merge in/merge
check in/pack dataset merge in/pack
check out/none dataset status in/run
check out/14 dataset stats in/whole --report out/14/a.html
check out/15 preset show physical -o out/15
check out/16 man --dir out/16
check out/none evaluate in/a.dat
check out/none effects
check out/none partials out
check out partials out --delete
exit $failed
