#!/usr/bin/env bash
# Tests the C library as an outside project would use it. Builds and installs the library, then compiles programs in C and C++,
# with CMake, with pkg-config and with the command of the README. Runs programs under valgrind and AddressSanitizer.
# A missing tool is an error, unless ALLOW_SKIP, a comma-separated list, names the tool.
set -euo pipefail
cd "$(dirname "$0")/../.."
here=bindings/c
. .ci/skip.sh

say() { echo "bindings/c: $*"; }
cc=${CC:-cc}
command -v "$cc" >/dev/null || { missing "$cc" "the C library"; exit 0; }

# `--bench plan --test header` select the same dependencies and features as `cargo test --workspace`. So cargo reuses every
# compiled crate.
PYO3_BUILD_EXTENSION_MODULE=1 cargo build -q --workspace --lib --bin spikelane --bench plan --test header
out=target/c
rm -rf "$out"
mkdir -p "$out"
$here/install.sh "$out/prefix" target/debug >/dev/null
prefix=$PWD/$out/prefix
export LD_LIBRARY_PATH=$prefix/lib PKG_CONFIG_PATH=$prefix/lib/pkgconfig
table=tests/golden.json
strict="-std=c11 -O2 -Wall -Wextra -Werror -Wpedantic -D_DEFAULT_SOURCE"
strictpp="-std=c++17 -O2 -Wall -Wextra -Werror -Wpedantic"
use="-I$prefix/include -L$prefix/lib -lspikelane -lm -lpthread"

if command -v nm >/dev/null && [ "$(uname)" = Linux ]; then
    nm -D --defined-only "$prefix/lib/libspikelane.so" | awk '{print $3}' | LC_ALL=C sort >"$out/symbols.txt"
    diff "$here/symbols.txt" "$out/symbols.txt" ||
        { say "the library exports other symbols (>) than symbols.txt (<)"; exit 1; }
else
    missing nm "the check of exported symbols"
fi

for program in tests/golden tests/misuse examples/run examples/render_loop examples/virtual_camera examples/ring_reader; do
    $cc $strict "$here/$program.c" $use -o "$out/$(basename $program)"
done
"$out/golden" $table
"$out/misuse" "$out"
"$out/run"
"$out/render_loop" 100
"$out/virtual_camera" 0.3 2000 | wc -c

cxx=${CXX:-c++}
if command -v "$cxx" >/dev/null; then
    $cxx $strictpp "$here/tests/golden.cpp" $use -o "$out/goldenpp"
    "$out/goldenpp" $table
    if pkg-config --exists opencv4 2>/dev/null; then
        # `-isystem` hides warnings about the headers of OpenCV.
        $cxx $strictpp $(pkg-config --cflags opencv4 | sed 's/-I/-isystem /g') "$here/examples/opencv_to_dat.cpp" $use \
            $(pkg-config --libs opencv4) -o "$out/opencv_to_dat"
        say "opencv_to_dat compiles"
    else
        missing opencv "examples/opencv_to_dat.cpp"
    fi
else
    missing "$cxx" "the test from C++"
fi

# Checks the README: its program equals examples/run.c, and its command compiles the program.
awk '/^```c$/ {on = 1; next} /^```$/ {on = 0} on' $here/README.md >"$out/spikes.c"
diff "$out/spikes.c" $here/examples/run.c || { say "README.md has another program than examples/run.c"; exit 1; }
# The programs of the guide in C, Rust and Python must print the same number of spikes.
awk '/^```c$/ {on = 1; next} /^```$/ {on = 0} on' docs/guides/embedding.md >"$out/guide.c"
$cc $strict "$out/guide.c" $use -o "$out/guide"
expected=$(sed -n 's/^Each program prints \([0-9,]*\) spikes.*/\1/p' docs/guides/embedding.md | tr -d ,)
[ "$("$out/guide")" = "$expected spikes" ] || { say "the program of docs/guides/embedding.md prints another number than $expected"; exit 1; }
if command -v pkg-config >/dev/null; then
    line=$(grep '^cc ' $here/README.md)
    (cd "$out" && eval "$line -Wall -Wextra -Werror" && ./spikes)
else
    missing pkg-config "the check of its file"
fi

# `live` must deliver to each kind of consumer the bytes of the file that `simulate` writes. After Ctrl-C, `live` must exit with
# code 0. Without --foreground, `timeout` sends the signal twice, and a second Ctrl-C ends the process at once.
spikelane=$PWD/target/debug/spikelane
light=(--builtin-light chart --width 80 --height 60 --threads 1)
"$spikelane" simulate "${light[@]}" --readouts 4000 -o "$out/chart.dat" --force 2>/dev/null >/dev/null
"$spikelane" live "${light[@]}" --readouts 4000 --sink pipe --block | cmp - "$out/chart.dat"
mkfifo "$out/fifo"
cmp "$out/fifo" "$out/chart.dat" &
reader=$!
"$spikelane" live "${light[@]}" --readouts 4000 --sink "pipe:$out/fifo" --block
wait $reader
"$spikelane" live "${light[@]}" --readouts 4000 --sink tcp:127.0.0.1:0 --block 2>"$out/tcp" &
camera=$!
for _ in $(seq 100); do grep -q 'waiting for a consumer' "$out/tcp" && break || sleep 0.1; done
port=$(sed -n 's/^waiting for a consumer at tcp:127.0.0.1://p' "$out/tcp")
cmp - "$out/chart.dat" <"/dev/tcp/127.0.0.1/$port"
wait $camera
timeout --foreground --preserve-status -s INT 1 "$spikelane" live "${light[@]}" --sink pipe | head -c 1000000 >/dev/null ||
    { say "live: the exit code is not 0 after the consumer closed the pipe or after Ctrl-C"; exit 1; }
timeout --foreground --preserve-status -s INT 1 "$spikelane" live "${light[@]}" --sink pipe >/dev/null ||
    { say "live: the exit code is not 0 after Ctrl-C"; exit 1; }
if [ -d /dev/shm ]; then
    # This consumer uses no library and reads the layout of the ring directly.
    ring=spikelane-ci-$$
    "$out/ring_reader" "/dev/shm/$ring" >"$out/ring" &
    reader=$!
    "$spikelane" live "${light[@]}" --readouts 4000 --sink "shm:$ring" --block
    wait $reader
    cat "$out/ring"
    spikes=$(sed -n 's/^ *"spikes": \([0-9]*\).*/\1/p' "$out/chart.json" | head -1)
    grep -q "^4000 readouts, 0 lost, $spikes spikes" "$out/ring" || { say "the ring differs from the file, which has $spikes spikes"; exit 1; }
else
    say "the ring is not checked: no /dev/shm"
fi

if command -v valgrind >/dev/null; then
    grind="valgrind -q --error-exitcode=9 --leak-check=full --errors-for-leak-kinds=definite"
    $grind "$out/golden" $table portable
    $grind "$out/golden" $table avx2
    $grind "$out/misuse" "$out"
    $grind "$out/run" >/dev/null
    $grind "$out/render_loop" 20
    $grind "$out/virtual_camera" 0.05 2000 | wc -c
    [ ! -x "$out/goldenpp" ] || $grind "$out/goldenpp" $table
else
    missing valgrind "the check of memory"
fi

asan="-g -fsanitize=address,undefined -fno-sanitize-recover=undefined"
if echo 'int main(void) { return 0; }' | $cc $asan -x c - -o "$out/asan" 2>/dev/null; then
    for program in golden misuse; do
        $cc $strict $asan "$here/tests/$program.c" $use -o "$out/$program-asan"
    done
    "$out/golden-asan" $table portable
    "$out/misuse-asan" "$out"
else
    missing asan "the check with AddressSanitizer"
fi

cmake=$(command -v cmake || true)
if [ -z "$cmake" ] && [ -x target/python/bin/pip ] && target/python/bin/pip install -q cmake 2>/dev/null; then
    cmake=target/python/bin/cmake
fi
if [ -n "$cmake" ]; then
    "$cmake" -S $here/tests/cmake -B "$out/cmake" -DCMAKE_PREFIX_PATH="$prefix" -DEXAMPLES="$PWD/$here/examples" >/dev/null
    "$cmake" --build "$out/cmake" >/dev/null
    "$out/cmake/run"
    "$out/cmake/run_static"
else
    missing cmake "the CMake package"
fi
