#!/bin/bash
# Runs commands under limits of the system. Usage: tests/limits.sh [PROGRAM]
#   Prints a table of exit codes, with a row for each command and a column for each limit:
#     read-only  a read-only folder, as user 65534 (needs root and setpriv)
#     disk       a disk of 192 kB (a tmpfs; needs root), or with ALLOW_SKIP=mount a limit of 64 kB per file
#     1 thread   RAYON_NUM_THREADS=1, and --threads 1 if the command has this flag
#     64 files   ulimit -n 64
#     512 MB     ulimit -v 524288
#   ALLOW_SKIP is a comma-separated list of tools that may be missing: setpriv (column read-only), mount, python3.
#   Exits with code 1 if
#     a command exits with a code that docs/reference/errors.md does not list (a panic, an abort, a signal),
#     a failed command leaves a file, or
#     the message about a read-only folder or a full disk names no remedy.
set -u
cd "$(dirname "$0")/.."
. tests/script_inputs.sh
program=$(realpath "${1:-target/debug/spikelane}")
listed=" $(sed -n 's/^| \([0-9]*\) |.*/\1/p' docs/reference/errors.md | tr '\n' ' ')"
work=$(mktemp -d)
chmod 755 "$work"
mounted=
unprivileged=
finish() {
    [ -z "$mounted" ] || umount "$work/disk"
    rm -rf "$work"
}
trap finish EXIT
mkdir "$work/in" "$work/disk" "$work/free"
cd "$work"
cp "$program" ./spikelane
program=$work/spikelane
mount -t tmpfs -o size=192k tmpfs "$work/disk" 2>/dev/null && mounted=yes
[ "$(id -u)" = 0 ] && command -v setpriv >/dev/null && unprivileged=yes
[ -n "$unprivileged" ] || missing setpriv "the column read-only, as root,"
[ -n "$mounted" ] || missing mount "the column disk, on a tmpfs,"

make_inputs
# The stream has 400 kB, which exceeds the small disk.
quiet simulate --builtin-light chart --width 64 --height 50 --readouts 1000 -o in/a
quiet dataset plan $tiny -o in/plan --sequences-per-shard 1
chmod -R a+rX in

failed=0
wrong() {
    failed=1
    echo "    $*"
}

# once COLUMN OUT LINE: runs the command LINE under the limit COLUMN with the output folder OUT, and prints the exit code.
once() {
    local column=$1 out=$2 line=$3
    local run=("$program") code
    local threads=
    case "$column" in
    read-only) run=(setpriv --reuid 65534 --regid 65534 --clear-groups "$program") ;;
    "1 thread") case "$line" in simulate* | scene* | dataset\ --* | dataset\ run*) threads="--threads 1" ;; esac ;;
    esac
    (
        case "$column" in
        disk) [ -n "$mounted" ] || ulimit -f 64 ;;
        "1 thread") export RAYON_NUM_THREADS=1 ;;
        "64 files") ulimit -n 64 ;;
        "512 MB") ulimit -v 524288 ;;
        esac
        # shellcheck disable=SC2086
        exec timeout 600 "${run[@]}" ${line//OUT/$out} $threads >stdout 2>stderr
    )
    code=$?
    printf '%9s' $code
    case "$listed" in *" $code "*) ;; *) notes+=("$column: code $code is not listed: $(tail -1 stderr)") ;; esac
    # `run OUT` and `merge OUT` work in a folder that contained files before the command, so the check skips both.
    if [ $code -ne 0 ] && [[ $line == *OUT* ]] && [[ $line != *"run OUT"* && $line != *"merge OUT"* ]]; then
        local left
        left=$(find "$out" -mindepth 1 2>/dev/null | head -3 | tr '\n' ' ')
        # Finished sequences of a data set remain, because a rerun resumes. Complete recordings and numbered images remain too.
        [[ $line == dataset\ --* || $line == record* || $line == *pictures* || $line == scene* ]] || [ -z "$left" ] || notes+=("$column: left $left")
    fi
    case "$column:$code" in
    read-only:0) [[ $line == *OUT* ]] && notes+=("$column: nothing was refused") ;;
    read-only:* | disk:[1-9]*) grep -q ';' stderr || notes+=("$column: no remedy: $(tail -1 stderr)") ;;
    esac
}

columns=("read-only" "disk" "1 thread" "64 files" "512 MB")
printf '%-28s' command
printf '%10s' "${columns[@]}"
echo
row() {
    local name=$1 line=$2
    notes=()
    printf '%-28s' "$name"
    for column in "${columns[@]}"; do
        printf ' '
        if [ "$column" = read-only ] && [ -z "$unprivileged" ]; then
            printf '%9s' skipped
            continue
        fi
        # The command creates its output folder inside this existing folder.
        local place=$work/free/place
        [ "$column" = disk ] && [ -n "$mounted" ] && place=$work/disk/place
        rm -rf "$place"
        mkdir -p "$place"
        if [ -n "${3:-}" ]; then
            if ! cp -a "in/$3/." "$place/" 2>/dev/null; then
                printf '%9s' skipped
                continue
            fi
            once "$column" "$place" "$line"
        else
            once "$column" "$place" "$line"
        fi
    done
    echo
    for note in "${notes[@]}"; do wrong "$note"; done
}

row simulate "simulate --builtin-light chart --width 64 --height 50 --readouts 1000 --clean -o OUT/a"
row "simulate --images-every" "simulate --builtin-light chart --width 64 --height 50 --readouts 400 --images-every 1 -o OUT/a"
row "simulate (video in)" "simulate in/p1.png --motion pan=5,5 --width 64 --height 64 --readouts 1000 -o OUT/a"
row inspect "inspect in/a.dat --png OUT/a.png --digest"
row convert "convert in/a.dat OUT/a.npy"
row "convert --to events" "convert in/a.dat OUT/a.npy --to events"
row verify "verify in/a.dat"
row "reconstruct (png)" "reconstruct in/a.dat -o OUT/a.png"
row "reconstruct (npy)" "reconstruct in/a.dat -o OUT/a.npy --every 20"
row "reconstruct (folder)" "reconstruct in/a.dat -o OUT/pictures --every 10"
row evaluate "evaluate in/a.dat"
row measure "measure in/a.dat --report OUT/a.html"
row record "record --width 64 --height 48 --readouts 200 -o OUT/set"
row calibrate "calibrate in/set.toml -o OUT/made"
row compare "compare in/set.toml ideal --max-readouts 50 -o OUT/made"
row diagnose "diagnose in/set.toml --camera physical -o OUT/made"
row scene "scene --width 200 --height 120 --frames 3 -o OUT/scene"
row dataset "dataset --scene-preset tiny --sequences 3 --images-per-scene 40 --label-every 2 $small -o OUT/set"
row "dataset plan" "dataset plan $tiny -o OUT/plan --sequences-per-shard 1"
row "dataset run" "dataset run OUT --shards all" plan
row "dataset merge" "dataset merge OUT" merge
row "dataset stats" "dataset stats in/whole --report OUT/a.html"
row "preset show -o" "preset show vidar-measured -o OUT/camera"
row effects "effects"
row man "man --output OUT/man"
row partials "partials in"
rm -rf "$work/free/place" "$work/disk/place"

# Reads a file of 3 GB although the limited address space cannot map the whole file.
truncate -s 3G in/long.dat
for line in "inspect in/long.dat --readouts 0..100" "convert in/long.dat free/cut.dat --readouts 0..100" \
    "reconstruct in/long.dat --at 1000 -o free/cut.png"; do
    (ulimit -v 4000000 && exec "$program" $line --width 400 --height 250 --layout dat >stdout 2>stderr)
    code=$?
    printf '%-68s %9s\n' "3 GB under ulimit -v 4000000: ${line%% *}" $code
    [ $code -eq 0 ] || wrong "code $code: $(tail -1 stderr)"
done
exit $failed
