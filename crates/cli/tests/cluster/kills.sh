#!/usr/bin/env bash
# Kills `dataset run` (streams, labels, packs) and `dataset merge` with SIGKILL at random times. After each kill, no incomplete
# file may have its final name. In the end, the digest must equal the digest of an undisturbed run.
#   crates/cli/tests/cluster/kills.sh [PROGRAM] [KILLS] [SEED] [MINUTES] > crates/cli/tests/cluster/kills.txt
set -euo pipefail
program=$(realpath "${1:-target/debug/spikelane}")
kills=${2:-1000}
place=$(mktemp -d "${TMPDIR:-/tmp}/spikelane-kills.XXXXXX")
trap 'rm -rf "$place"' EXIT
python3 "$(dirname "$0")/kills.py" "$program" "$kills" "${3:-1}" "$place" "${4:-600}"
