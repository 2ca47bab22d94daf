#!/bin/sh
# Memory accesses of the kernels. Usage: tests/memcheck.sh valgrind|address
#   valgrind: AVX2 and portable under memcheck (valgrind knows no AVX-512 and hides it, so it is skipped and printed).
#   address:  every backend of this CPU, AVX-512 included, under AddressSanitizer. The flag is
#             unstable; RUSTC_BOOTSTRAP lets a stable compiler take it. Libraries are not instrumented.
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
    # A target of its own keeps build scripts and macros free of the sanitizer.
    RUSTC_BOOTSTRAP=1 RUSTFLAGS="-Zsanitizer=address" CARGO_TARGET_DIR=target/address \
        cargo test $features --target "$host" --test kernels_memory -- --nocapture
    ;;
*)
    echo "usage: tests/memcheck.sh valgrind|address" >&2
    exit 2
    ;;
esac
