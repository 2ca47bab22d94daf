#!/usr/bin/env bash
# Tests a data set on machines whose clocks differ. One machine plans the data set today. A machine whose clock is ten days slow
# generates one shard, and a machine whose clock is ten days fast generates the other. Then all three run both shards again.
# No run may generate a sequence twice, and the digest must equal the digest of one machine. Needs Debian's faketime.
#   crates/cli/tests/cluster/clocks.sh [PROGRAM] > crates/cli/tests/cluster/clocks.txt
set -euo pipefail
program=$(realpath "${1:-target/debug/spikelane}")
command -v faketime >/dev/null || { echo "clocks.sh: needs faketime" >&2; exit 2; }
place=$(mktemp -d "${TMPDIR:-/tmp}/spikelane-clocks.XXXXXX")
trap 'rm -rf "$place"' EXIT
cd "$place"
scenes="--scene-preset tiny --sequences 4 --images-per-scene 3 --label-every 2 --width 32 --height 24"
echo "date       $(date -u +%Y-%m-%d)"
one=$("$program" dataset $scenes -o one 2>/dev/null | sed -n 's/^digest //p')
echo "one clock  $one"
"$program" dataset plan $scenes -o set --sequences-per-shard 2 >/dev/null
faketime '10 days ago' "$program" dataset run set --shards 0 >/dev/null
faketime '+10 days' "$program" dataset run set --shards 1 >/dev/null
made=$(find set -name record.json -printf '%p %i %T@\n' | sort)
for clock in '10 days ago' '+0 days' '+10 days'; do
    faketime "$clock" "$program" dataset run set --shards all >/dev/null
    [ "$made" = "$(find set -name record.json -printf '%p %i %T@\n' | sort)" ] || { echo "MADE AGAIN at $clock"; exit 1; }
done
merged=$(faketime '10 days ago' "$program" dataset merge set | sed -n 's/^digest //p')
echo "three      $merged"
[ "$one" = "$merged" ] || { echo DIFFERENT; exit 1; }
echo "equal      and nothing was made twice"
