#!/usr/bin/env bash
# Smooths simulated recordings on a standalone Spark cluster (a master and two workers of one core, on the loopback address),
# once more while a worker is killed, and on Ray while a worker is killed; compares with plain Python.
#
#   spark-cluster.sh [RECORDINGS] [FILES OF OUTPUT BEFORE THE KILL] [ESTIMATOR] [ROWS OF A RECORDING]
#   spark-cluster.sh --scaling …         nothing is killed; each with one worker and with two
#
# As root it says the processor time of all processes, too.
#
# Wants Java, a Python with the ohmstrain wheel, pyspark and ray (PYTHON; default: `scripts/python.sh --engines` makes one and
# installs Java), and the program (OHMSTRAIN; default: built by cargo). ENGINES, `spark ray` by default, says which;
# TASK=copy computes nothing, so that what is left is the engines' own cost.
set -euo pipefail
cd "$(dirname "$0")/.."
scaling=
if [[ ${1:-} == --scaling ]]; then scaling=yes; shift; fi
readonly recordings=${1:-200} after_files=${2:-8} estimator=${3:-auto} rows=${4:-1000} engines=" ${ENGINES:-spark ray} "
readonly fleet=crates/python/examples/fleet.py
work=$(mktemp -d)
started=()
finish() {
    for pid in "${started[@]}"; do kill "$pid" 2>/dev/null || true; done
    wait
    rm -rf "$work"
    if [[ -n ${OHMSTRAIN_GROUP:-} ]]; then echo $$ >"$groups/cgroup.procs" && rmdir "$OHMSTRAIN_GROUP" || true; fi
}
trap finish EXIT

# A control group, for the processor time of all that is started here.
groups=/sys/fs/cgroup
if [[ -d $groups/cpuacct ]]; then groups=$groups/cpuacct; fi
if mkdir "$groups/ohmstrain-$$" 2>/dev/null; then
    export OHMSTRAIN_GROUP=$groups/ohmstrain-$$
    echo $$ >"$OHMSTRAIN_GROUP/cgroup.procs"
fi

if [[ -z ${OHMSTRAIN:-} ]]; then
    cargo build --quiet --locked -p ohmstrain-cli
    export OHMSTRAIN=$PWD/target/debug/ohmstrain
fi
python=${PYTHON:-$(scripts/python.sh --engines)}

SPARK_HOME=$("$python" -c 'import pyspark, os; print(os.path.dirname(pyspark.__file__))')
export SPARK_HOME PYSPARK_PYTHON=$python SPARK_LOCAL_IP=127.0.0.1 SPARK_WORKER_DIR=$work/workers SPARK_DAEMON_MEMORY=256m
export SPARK_NO_DAEMONIZE=1 PYTHONWARNINGS=ignore
port=$("$python" -c 'import socket; s = socket.socket(); s.bind(("127.0.0.1", 0)); print(s.getsockname()[1])')
readonly url=spark://127.0.0.1:$port

# service CLASS ARGUMENT...: a part of the cluster, in the background.
service() {
    "$SPARK_HOME/bin/spark-class" "org.apache.spark.deploy.$1" --host 127.0.0.1 "${@:2}" >"$work/$1-${#started[@]}.log" 2>&1 &
    started+=("$!")
}
if [[ $engines = *" spark "* ]]; then
    service master.Master --port "$port" --webui-port 0
    service worker.Worker --cores 1 --memory 1g --webui-port 0 "$url"
    service worker.Worker --cores 1 --memory 1g --webui-port 0 "$url"
    for _ in $(seq 60); do
        [[ $(cat "$work"/worker.Worker-*.log | grep -c 'Successfully registered') -eq 2 ]] && break
        sleep 1
    done
fi

# run ENGINE FLAG...: with what it says only where it fails.
run() {
    [[ " plain$engines" = *" $1 "* ]] || return 0
    "$python" $fleet run "$work/fleet" "$1" --task "${TASK:-smooth}" --estimator "$estimator" "${@:2}" 2>"$work/$1.log" || { cat "$work/$1.log" >&2; exit 1; }
    [[ $1 = plain ]] && return
    "$python" $fleet check "$work/fleet" "$1"
    rm -rf "$work/fleet/estimates-$1"
}
"$python" $fleet make "$work/fleet" --recordings "$recordings" --rows "$rows"
if [[ -n $scaling ]]; then
    for workers in 1 2; do
        run plain --workers "$workers"
        run spark --workers "$workers" --master "$url"
        run ray --workers "$workers"
    done
    exit
fi
run plain --checked-only
run spark --master "$url"
run spark --master "$url" --kill "${started[2]:-}" --after-files "$after_files"
run ray --kill any --after-files "$after_files"
