#!/bin/sh
# Checks the memory accesses of the kernels. Usage: tests/memcheck.sh valgrind|address
#   valgrind: runs the AVX2 and portable backends under memcheck. valgrind does not support AVX-512 and hides it from the test,
#             which skips the backend and prints the skip.
#   address:  runs every backend of this CPU, including AVX-512, under AddressSanitizer. The compiler flag is unstable, and
#             RUSTC_BOOTSTRAP makes a stable compiler accept it. The sanitizer does not instrument other libraries.
set -eu
cd "$(dirname "$0")/.."
features="--no-default-features"
case "${1:-}" in
valgrind)
    command -v valgrind >/dev/null || { echo "valgrind is not installed" >&2; exit 8; }
    binary=$(cargo test $features --test kernels_memory --no-run 2>&1 | sed -n 's/.*Executable.*(\(.*\))/\1/p')
    SPIKELANE_BACKEND=avx2 valgrind --quiet --error-exitcode=9 "$binary" --nocapture --test-threads=1
    ;;
address)
    host=$(rustc -vV | sed -n 's/host: //p')
    # With `--target`, cargo compiles build scripts and macros without the sanitizer.
    RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Zsanitizer=address" CARGO_TARGET_DIR=target/address \
        cargo test $features --target "$host" --test kernels_memory -- --nocapture
    ;;
*)
    echo "usage: tests/memcheck.sh valgrind|address" >&2
    exit 2
    ;;
esac
