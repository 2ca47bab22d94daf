#!/bin/bash
# Checks with strace that commands only write to the folder that the user named. The check covers every path that a command
# opens for writing, creates, renames, links or removes. Usage: tests/strace.sh [PROGRAM]
#   Prints a line for each command. Exits with code 1 if a path is outside the folder.
#   A missing strace, or a system that forbids tracing, is an error unless ALLOW_SKIP, a comma-separated list, names strace.
set -u
program=$(realpath "${1:-target/debug/spikelane}")
. "$(dirname "$0")/script_inputs.sh"
command -v strace >/dev/null || { missing strace "this check"; exit 0; }
work=$(mktemp -d)
trap 'rm -rf "$work"' EXIT
strace -o "$work/probe" true 2>/dev/null || { missing strace "this check, where it may trace,"; exit 0; }
cd "$work" && mkdir in

# strace does not trace the creation of the inputs.
make_inputs
quiet simulate --builtin-light chart $small --readouts 400 -o in/a
quiet dataset plan $tiny -o in/run --sequences-per-shard 1
quiet dataset plan $tiny -o in/pack --sequences-per-shard 1 --pack

calls=openat,open,creat,rename,renameat,renameat2,unlink,unlinkat,rmdir,mkdir,mkdirat,link,linkat,symlink,symlinkat,truncate,mknod,mknodat,chmod,fchmodat,chown,lchown,fchownat
failed=0
# check FOLDER ARGUMENTS...: runs the program with ARGUMENTS, and checks that it only writes inside FOLDER.
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
    # A failed call changes no file. An unfinished call counts as successful.
    if re.search(r"= -1 E", line):
        continue
    if call in ("open", "openat") and not re.search(r"O_WRONLY|O_RDWR|O_CREAT|O_TRUNC", line):
        continue
    quoted = list(re.finditer(r'(?:(?:AT_FDCWD|\d+)<([^>]*)>, )?"((?:[^"\\]|\\.)*)"', line))
    # A link call only reads its first path and creates its second path.
    if call.startswith("symlink") or call.startswith("link"):
        quoted = quoted[-1:]
    for match in quoted:
        base, name = match.group(1) or here, match.group(2)
        path = os.path.normpath(os.path.join(base, name))
        seen += 1
        if path == allowed or path.startswith(allowed + "/"):
            continue
        # A command may create missing parents of the folder that the user named.
        if call.startswith("mkdir") and allowed.startswith(path + "/"):
            continue
        # Neither device stores data.
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
    # A command that fails early would write nothing and pass the check.
    [ $code -eq 0 ] || { failed=1; tail -3 "$work/log"; }
}

check out/1 simulate --builtin-light chart $small --readouts 50 --clean --images-every 10 -o out/1/a
check out/1 simulate --builtin-light chart $small --readouts 50 --clean --images-every 10 -o out/1/a --force
check out/2 convert in/a.dat out/2/a.npy
check out/3 reconstruct in/a.dat -o out/3
check out/4 reconstruct in/a.dat -o out/4/a.png
check out/5 inspect in/a.dat --png out/5/a.png
check out/none verify in/a.dat
check out/6 measure in/a.dat --report out/6/a.html
check out/7 record --width 16 --height 12 --readouts 200 -o out/7
check out/8 calibrate in/set.toml -o out/8
check out/9 compare in/set.toml ideal --max-readouts 50 -o out/9
check out/10 diagnose in/set.toml --camera physical --cache out/10/cache -o out/10
check out/11 scene --width 32 --height 24 -o out/11
check out/12 dataset $tiny -o out/12
check out/12 dataset $tiny -o out/12 --resume
check out/13 dataset plan $tiny -o out/13 --sequences-per-shard 1
check in/run dataset run in/run --shards all
check in/pack dataset run in/pack --shards all
check in/merge dataset merge in/merge
check in/pack dataset merge in/pack
check out/none dataset status in/run
check out/14 dataset stats in/whole --report out/14/a.html
check out/15 preset show physical -o out/15
check out/16 man --output out/16
check out/none evaluate in/a.dat
check out/none effects
check out/none partials out
check out partials out --delete
exit $failed
