#!/usr/bin/env bash
# Tests a data set with a real Slurm on one machine. A controller and two node daemons on the loopback interface run 40 shards
# with the job of docs/guides/clusters.md. Meanwhile, the script kills a node, sends SIGKILL to one task and SIGTERM to another,
# and later fills a disk. The merged digest must equal the digest of a run on one thread.
# PYTHON is an interpreter with Ray. If given, Slurm starts a second folder and Ray finishes it with the script of the guide.
# Needs root and Debian's Slurm packages, which the script installs if they are missing. Removes all of its files at the end.
#   crates/cli/tests/cluster/slurm.sh [PROGRAM] [PYTHON] > crates/cli/tests/cluster/result.txt
set -euo pipefail
program=$(realpath "${1:-target/debug/spikelane}")
python=${2:-}
guide=$(realpath "$(dirname "$0")/../../../../docs/guides/clusters.md")
[ "$(id -u)" = 0 ] || { echo "slurm.sh: needs root for the node daemons and a small tmpfs" >&2; exit 2; }

if ! command -v slurmctld >/dev/null || ! command -v slurmd >/dev/null || ! command -v sbatch >/dev/null; then
    # policy-rc.d prevents that apt-get starts the services with a configuration from elsewhere.
    printf '#!/bin/sh\nexit 101\n' >/usr/sbin/policy-rc.d.spikelane
    [ -e /usr/sbin/policy-rc.d ] || { cp /usr/sbin/policy-rc.d.spikelane /usr/sbin/policy-rc.d; own_policy=1; }
    chmod +x /usr/sbin/policy-rc.d
    { apt-get update && DEBIAN_FRONTEND=noninteractive apt-get install -y --no-install-recommends \
        slurmctld slurmd slurm-client munge; } >/dev/null 2>&1 || { echo "slurm.sh: cannot install Slurm" >&2; exit 2; }
    rm -f /usr/sbin/policy-rc.d.spikelane
    [ -z "${own_policy:-}" ] || rm -f /usr/sbin/policy-rc.d
fi

place=$(mktemp -d /tmp/spikelane-slurm.XXXXXX)
started=()
cleanup() {
    scancel --user root >/dev/null 2>&1 || true
    for pid in "${started[@]}"; do kill "$pid" 2>/dev/null || true; done
    sleep 1
    for pid in "${started[@]}"; do kill -9 "$pid" 2>/dev/null || true; done
    mountpoint -q "$place/small" && umount "$place/small"
    rm -rf "$place"
}
trap cleanup EXIT
mkdir -p "$place"/{state,spool-a,spool-b,small,logs,bin}
ln -s "$program" "$place/bin/spikelane"
export PATH="$place/bin:$PATH"
host=$(hostname -s)
cpus=$(nproc)
cat >"$place/slurm.conf" <<CONF
ClusterName=loopback
SlurmctldHost=$host(127.0.0.1)
SlurmctldPort=46817
SlurmUser=root
SlurmdUser=root
AuthType=auth/none
CredType=cred/none
CryptoType=crypto/none
MpiDefault=none
ProctrackType=proctrack/pgid
TaskPlugin=task/none
SwitchType=switch/none
JobAcctGatherType=jobacct_gather/none
SelectType=select/linear
SchedulerType=sched/builtin
CommunicationParameters=NoCtldInAddrAny,NoInAddrAny
ReturnToService=2
SlurmdTimeout=20
InactiveLimit=0
KillWait=5
MinJobAge=5000
JobRequeue=1
StateSaveLocation=$place/state
SlurmdSpoolDir=$place/spool-%n
SlurmctldPidFile=$place/slurmctld.pid
SlurmdPidFile=$place/slurmd-%n.pid
SlurmctldLogFile=$place/logs/slurmctld.log
SlurmdLogFile=$place/logs/slurmd-%n.log
NodeName=a NodeHostname=$host NodeAddr=127.0.0.1 Port=46818 CPUs=$cpus State=UNKNOWN
NodeName=b NodeHostname=$host NodeAddr=127.0.0.1 Port=46819 CPUs=$cpus State=UNKNOWN
PartitionName=all Nodes=a,b Default=YES MaxTime=INFINITE State=UP OverSubscribe=FORCE:2
CONF
sed -i '/CryptoType/d' "$place/slurm.conf"
export SLURM_CONF="$place/slurm.conf"
slurmctld -D -c >"$place/logs/ctl.out" 2>&1 &
started+=($!)
sleep 2
for node in a b; do
    slurmd -D -N "$node" >"$place/logs/$node.out" 2>&1 &
    started+=($!)
    eval "pid_$node=$!"
done
for _ in $(seq 60); do
    [ "$(sinfo -h -o %T 2>/dev/null | sort -u)" = idle ] && break
    sleep 1
done
sinfo -h -o '%N %T' | grep -q idle || { cat "$place"/logs/* >&2; echo "slurm.sh: Slurm did not come up" >&2; exit 1; }

scenes="--scene-preset tiny --sequences 80 --images-per-scene 240 --label-every 60 --width 64 --height 40"
echo "date            $(date -u +%Y-%m-%d)"
echo "slurm           $(slurmctld -V)"
echo "dataset         $scenes, 2 sequences a shard"
"$program" dataset $scenes -o "$place/one" --threads 1 >"$place/one.txt" 2>/dev/null
one=$(sed -n 's/^digest //p' "$place/one.txt")
echo "one thread      $one"

"$program" dataset plan $scenes -o "$place/set" --sequences-per-shard 2 >/dev/null
sed -n '/^```bash$/,/^```$/p' "$guide" | sed '1d;$d' >"$place/job.sh"
submit() { # ARRAY: submits the guide's job in the parent folder of the data set
    (cd "$place" && sbatch --parsable --array="$1" --cpus-per-task=1 --output="$place/logs/%a.txt" job.sh)
}
finished() { # JOB: waits until no task of JOB is queued or running
    for _ in $(seq 1800); do
        [ "$(squeue -h -j "$1" -t PD,R,CG,CF 2>/dev/null | wc -l)" = 0 ] && return 0
        sleep 0.5
    done
    echo "slurm.sh: job $1 does not end" >&2
    exit 1
}
job=$(submit 0-39)

# Sets `pid` to the process of the first running shard with a number of at least $1, and `shard` to its number. Reads the process
# number from the lock file of the shard.
worker() {
    for _ in $(seq 600); do
        for lock in "$place"/set/shards/*/lock; do
            shard=$(basename "$(dirname "$lock")")
            [ "$((10#$shard))" -ge "$1" ] || continue
            pid=$(awk '{print $3}' "$lock" 2>/dev/null) || continue
            [ -n "$pid" ] && [ ! -e "$(dirname "$lock")/manifest.jsonl" ] && kill -0 "$pid" 2>/dev/null && return 0
        done
        sleep 0.05
    done
    return 1
}
done_shards() { ls "$place"/set/shards/*/manifest.jsonl 2>/dev/null | wc -l; }
until [ "$(done_shards)" -ge 5 ]; do sleep 0.2; done
worker 0 || { echo "slurm.sh: no task to kill" >&2; exit 1; }
kill -KILL "$pid" && echo "SIGKILL         shard $((10#$shard))"
until [ "$(done_shards)" -ge 10 ]; do sleep 0.2; done
worker 0 || { echo "slurm.sh: no task to end" >&2; exit 1; }
termed=$((10#$shard))
# Slurm sends this signal to the shell of the job before a time limit. The shell forwards the signal.
scancel --signal=TERM --batch "${job}_$termed" 2>/dev/null &
echo "SIGTERM         shard $termed"
until [ "$(done_shards)" -ge 15 ]; do sleep 0.2; done
# Kills a node with its tasks, because the tasks of a failed node also end.
mapfile -t children < <(ps -eo pid,args | awk '/slurmstepd: \[/ {print $1}')
for _ in $(seq 300); do
    on_b=$(squeue -h -w b -t R -o %i | tr '\n' ' ')
    [ -n "$on_b" ] && break
    sleep 0.1
done
kill -KILL "$pid_b"
for child in "${children[@]}"; do
    jobid=$(ps -o args= -p "$child" 2>/dev/null | sed -n 's/.*\[\([0-9]*\).*/\1/p')
    node=$(scontrol show job "$jobid" 2>/dev/null | sed -n 's/^ *NodeList=//p')
    [ "$node" = b ] || continue
    for task in $(ps -o pid= --ppid "$child"); do kill -KILL "$task" 2>/dev/null || true; done
    kill -KILL "$child" 2>/dev/null || true
done
# Also kills the processes of the shards, which can outlive their shells.
for task in $on_b; do
    shard=$(printf %06d "${task#*_}")
    pid=$(awk '{print $3}' "$place/set/shards/$shard/lock" 2>/dev/null) && kill -KILL "$pid" 2>/dev/null || true
done
echo "node killed     b, tasks $on_b"
finished "$job"
status=$("$program" dataset status "$place/set" --json)
array=$(printf '%s' "$status" | sed -n 's/.*"shard_array":"\([^"]*\)".*/\1/p')
echo "after the array ${array:-nothing} missing"
grep -q "queue the same command again" "$place/logs/$termed.txt" || { echo "shard $termed did not end on SIGTERM"; exit 1; }
echo "SIGTERM ended   shard $termed with code 75, and the job queued it again"
grep -q "Requeuing\|requeue" "$place/logs/slurmctld.log" || { echo "Slurm did not queue the node's tasks again"; exit 1; }
echo "node failure    Slurm queued its tasks again"
if [ -n "$array" ]; then
    finished "$(submit "$array")"
    echo "sbatch again    --array=$array"
fi
"$program" dataset merge "$place/set" >"$place/merged.txt" 2>"$place/merged.err" || { cat "$place/merged.err"; exit 1; }
merged=$(sed -n 's/^digest //p' "$place/merged.txt")
echo "merged          $merged"

# Runs a shard on a full disk: a tmpfs that is too small for the shard. Then enlarges the tmpfs and runs the shard again.
mount -t tmpfs -o size=300k tmpfs "$place/small"
"$program" dataset plan $scenes -o "$place/small/set" --sequences-per-shard 80 >/dev/null
code=0; "$program" dataset run "$place/small/set" --shards 0 >/dev/null 2>"$place/full.err" || code=$?
echo "full disk       code $code: $(tail -1 "$place/full.err" | sed "s|$place/||g" | cut -c1-100)"
half=$(find "$place/small/set/shards" -name '*.partial' | wc -l)
mount -o remount,size=200m "$place/small"
"$program" dataset run "$place/small/set" --shards 0 >/dev/null 2>&1
small=$("$program" dataset merge "$place/small/set" 2>/dev/null | sed -n 's/^digest //p')
echo "after room      $half files half-written left by the full disk; $small"
both="one thread, 40 shards of Slurm, and the disk that was full"

if [ -n "$python" ]; then
    rm -rf "$place/set"
    "$program" dataset plan $scenes -o "$place/set" --sequences-per-shard 2 >/dev/null
    finished "$(submit 0-11)"
    echo "begun by Slurm  $("$program" dataset status "$place/set" | head -1)"
    sed -n '/^```python needs python:ray$/,/^```$/p' "$guide" | sed '1d;$d' | sed 's/^shards = .*/shards = 40/' >"$place/finish.py"
    (cd "$place" && "$python" finish.py >"$place/ray.txt" 2>&1) || { tail -20 "$place/ray.txt"; exit 1; }
    ray=$("$program" dataset merge "$place/set" 2>/dev/null | sed -n 's/^digest //p')
    echo "ended by Ray    $("$python" -c 'import ray; print(ray.__version__)'): $ray"
    [ "$one" = "$ray" ] || { echo "DIFFERENT"; exit 1; }
    both="$both, and the folder that Ray finished"
fi
[ "$one" = "$merged" ] && [ "$one" = "$small" ] && [ "$half" = 0 ] || { echo "DIFFERENT"; exit 1; }
echo "equal           $both"
