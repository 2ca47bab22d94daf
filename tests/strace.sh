#!/bin/bash
# Checks with strace that commands only write to the folder that the user named. The check covers every path that a command
# opens for writing, creates, renames, links or removes. The script also compares the programs that commands start, and the
# addresses on which they listen, with the table in SECURITY.md. Usage: tests/strace.sh [PROGRAM]
#   Prints a line for each command. Exits with code 1 if a path is outside the folder, or if the table differs.
#   A missing strace, or a system that forbids tracing, is an error unless ALLOW_SKIP, a comma-separated list, names strace.
set -u
program=$(realpath "${1:-target/debug/spikelane}")
page=$(realpath "$(dirname "$0")/../SECURITY.md")
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
calls+=,execve,bind,listen,connect
failed=0
count=0
# trace ARGUMENTS...: runs the program with ARGUMENTS, and writes its system calls to a new file.
trace() {
    count=$((count + 1))
    trace="$work/trace-$count"
    echo "$*" >"$trace-command"
    strace -f -y -qq -s 4096 -e trace=$calls -e signal=none -o "$trace" "$program" "$@" >"$work/stdout" 2>"$work/log"
}

# check FOLDER ARGUMENTS...: runs the program with ARGUMENTS, and checks that it only writes inside FOLDER.
check() {
    local folder=$1
    shift
    trace "$@"
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
    if call in ("execve", "bind", "listen", "connect"):
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

# Commands that start other programs or listen. Stubs replace the browser, Python and the method of a benchmark.
mkdir -p bin out/17
for stub in xdg-open method python-stub; do
    printf '#!/bin/true\n' >"bin/$stub"
    chmod +x "bin/$stub"
done
PATH="$work/bin:$PATH"
# starts ARGUMENTS...: runs the program with ARGUMENTS. Its exit code does not matter.
starts() {
    trace "$@"
    printf '%-60.60s code %d\n' "$*" $?
}
if command -v ffmpeg >/dev/null; then
    ffmpeg -v error -f lavfi -i testsrc=size=32x24:rate=25:duration=1 -pix_fmt yuv420p in/clip.mp4
    mkdir -p in/clips && cp in/clip.mp4 in/clips
    check out/18 simulate in/clip.mp4 $small --readouts-per-frame 40 -o out/18/a
    check out/19 dataset --from in/clips $small --readouts-per-frame 40 -o out/19
    check out/20 dataset plan --from in/clips $small --readouts-per-frame 40 --sequences-per-shard 1 -o out/20
    check out/20 dataset run out/20 --shards all
    check out/21 reconstruct in/a.dat --every 100 -o out/21/a.mp4
    check out/22 scene --width 32 --height 24 --frames 2 --video -o out/22
    check out/23 dataset preview in/whole -o out/23/a.mp4
    starts check spikecv in/clip.mp4 --code in --python python-stub
    starts live in/clip.mp4 $small --readouts-per-frame 40 --sink pipe
else
    missing ffmpeg "the part of this check with videos"
fi
cat >tiny.toml <<'TOML'
format_version = 1
name = "tiny"
version = "0.1.0"
description = "Which programs does a benchmark start?"
scene_version = 3
release = "0.1.0"
task = "reconstruction"
metrics = ["psnr/1"]
dataset.scenes = { images_per_scene = 9, label_every = 0, samples = 4, vehicles = 0 }
dataset.images = { every = 4, format = "f32" }
dataset.camera = { preset = "physical", sensor = { width = 48, height = 32 } }
splits = [{ name = "test", seed = 5, sequences = 1 }]
TOML
check out/24 benchmark seal tiny.toml -o out/24/round
check out/25 benchmark generate tiny.toml -o out/25
check out/26 benchmark run out/25 --command 'method {stream} {output}' -o out/26
check out/27 benchmark run out/25 --server method -o out/27
check out/28 benchmark verify out/26/score.json --suite out/25 --run out/28
printf '<!-- benchmark tiny: begin -->\n<!-- benchmark tiny: end -->\n' >out/17/page.md
check out/17 benchmark report out/26/score.json -o out/17/a --markdown out/17/page.md
# `view` ends after its page is closed. The page is opened as soon as its address is printed.
trace view in/a.dat &
python3 - "$work/stdout" <<'PY'
import re, socket, sys, time
address = None
while not address:
    time.sleep(0.1)
    address = re.search(r"http://127\.0\.0\.1:(\d+)(/[0-9a-f]+/)", open(sys.argv[1]).read())
page = socket.create_connection(("127.0.0.1", int(address[1])))
page.sendall(f"GET {address[2]}api/open HTTP/1.1\r\nHost: 127.0.0.1:{address[1]}\r\n\r\n".encode())
page.recv(100)
PY
wait $!
count=$((count + 1))
printf '%-60.60s code %d\n' "view in/a.dat" $?
# `live` ends when its only client disconnects.
trace live --builtin-light chart $small --readouts 100000 --sink tcp:127.0.0.1:0 &
python3 - "$work/log" <<'PY'
import re, socket, sys, time
address = None
while not address:
    time.sleep(0.1)
    address = re.search(r"tcp:127\.0\.0\.1:(\d+)", open(sys.argv[1]).read())
socket.create_connection(("127.0.0.1", int(address[1]))).close()
PY
wait $!
count=$((count + 1))
printf '%-60.60s code %d\n' "live --sink tcp:127.0.0.1:0" $?
# `speed` starts its first programs before the measurement, which the limit of processor time ends.
(ulimit -t 5 && starts speed --quick)
count=$((count + 1))

python3 - "$page" "$work" <<'PY' || failed=1
import glob, os, re, sys
page, work = sys.argv[1:]
# The rows of the table in SECURITY.md: command, programs, address.
listed, addresses = {}, {}
for line in open(page):
    cells = [cell.strip() for cell in line.split("|")[1:-1]]
    if len(cells) != 3:
        continue
    for command in re.findall("`([^`]+)`", cells[0]):
        name = command.split(" -")[0]
        listed.setdefault(name, set()).update(re.findall("`([^`]+)`", cells[1]))
        if cells[2]:
            addresses[name] = cells[2]
# The script passes 127.0.0.1 as the given address.
allowed = {"127.0.0.1": "127.0.0.1", "the given address": "127.0.0.1"}
# Stubs, programs that only other systems have, and programs that the short run of `speed` does not reach.
stubs = {"method": {"--command", "--server"}, "python-stub": {"--python"}}
unseen = {"view": {"open", "rundll32"}, "speed": {"spikelane"}}
seen, listeners, wrong = {}, set(), []
for command in sorted(glob.glob(f"{work}/trace-*-command")):
    words = open(command).read().split()
    name = " ".join(words[:2]) if " ".join(words[:2]) in listed or words[0] == "benchmark" else words[0]
    started = 0
    for line in open(command.removesuffix("-command"), errors="replace"):
        # The first call starts the program itself. A failed call starts nothing.
        if "execve(" in line and not re.search("= -1 E", line):
            started += 1
            program = os.path.basename(re.search(r'execve\("([^"]*)"', line)[1])
            names = stubs.get(program, {program})
            if started > 1:
                seen.setdefault(name, set()).update(names)
                if not names & listed.get(name, set()):
                    wrong.append(f"{' '.join(words)}: starts {program}")
        if re.search(r"\b(bind|listen|connect)\(", line) and "AF_INET" in line:
            address = re.search(r'inet_(?:addr|pton)\((?:AF_INET6, )?"([^"]*)"', line)
            listeners.add(name)
            if not address or address[1] != allowed.get(addresses.get(name)):
                wrong.append(f"{' '.join(words)}: {line.strip()}")
        elif re.search(r"\blisten\(", line) and name not in addresses:
            wrong.append(f"{' '.join(words)}: {line.strip()}")
if os.path.exists(f"{work}/in/clip.mp4"):
    for name, programs in listed.items():
        missing = programs - seen.get(name, set()) - unseen.get(name, set())
        wrong += [f"{name}: the page lists {program}, which was not started" for program in sorted(missing)]
wrong += [f"{name}: the page lists a listener, which was not seen" for name in sorted(set(addresses) - listeners)]
print(f"programs of {len(listed)} commands and {len(listeners)} listeners compared with {os.path.basename(page)}")
print("\n".join(f"    {line}" for line in wrong))
sys.exit(1 if wrong else 0)
PY
exit $failed
