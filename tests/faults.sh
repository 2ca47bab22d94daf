#!/bin/bash
# Makes every call of the C library fail once, in short runs of commands. Usage: tests/faults.sh [PROGRAM]
#   Prints a row for each command and fault: the number of calls, of tried calls and of wrong ends. A wrong end is an exit code
#   that docs/reference/errors.md does not list, a lost or changed file of the user, an incomplete file under its final name, a
#   hidden file after a regular end, a command that takes 20 s, or a rerun that fails.
#   FAULT selects faults by a part of their name, such as `disk`. Exits with code 1 after a wrong end.
set -eu
SPIKELANE=$(realpath "${1:-target/debug/spikelane}")
export SPIKELANE
cd "$(dirname "$0")/.."
printf '%-16s %-18s %6s %6s %6s\n' command fault calls tried wrong
cargo test --quiet -p spikelane-cli --test program faults::every_ -- --ignored --nocapture --test-threads=1
