#!/bin/sh
# Runs all dieharder tests on the random words, in each order in which the kernels use the words. Takes hours.
# Usage: benches/random.sh [ORDER...]. Writes the results to out/random/.
set -eu
cd "$(dirname "$0")/.."
command -v dieharder >/dev/null || { echo "dieharder is not installed (Debian: apt-get install dieharder)" >&2; exit 8; }
cargo build --release --quiet --no-default-features --example random_words
mkdir -p out/random
[ $# -gt 0 ] || set -- pixels readouts streams
for order in "$@"; do
    echo "dieharder -a on the order along $order" >&2
    ./target/release/examples/random_words "$order" 1 | dieharder -a -g 200 -k 2 -Y 1 > "out/random/$order.txt"
    grep -c -E 'PASSED' "out/random/$order.txt" | sed "s/^/$order: passed /"
    grep -E 'WEAK|FAILED' "out/random/$order.txt" || echo "$order: no test weak or failed"
done
