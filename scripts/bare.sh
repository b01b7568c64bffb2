#!/usr/bin/env bash
# Installs what release.sh has made in bare Debian systems that have nothing but a Python, a Node or a C compiler, and runs the main job
# there: calibrate on a recording and filter it (in C: compile, and filter). Prints the seconds from the arrival of the package.
#
#   bare.sh [python|node|c]...
#
# Needs root and mmdebstrap, and a mirror of Debian; a package index for what the Python package depends on.
set -euo pipefail
cd "$(dirname "$0")/.."
readonly out=$PWD/dist/release
(($#)) || set -- python node c
[[ $EUID -eq 0 ]] || { echo "NOT TRIED: bare systems, since only root can make them" >&2 && exit 0; }
scripts/apt.sh mmdebstrap
suite=$(. /etc/os-release && { [[ $ID == debian ]] && echo "$VERSION_CODENAME" || echo stable; })
readonly suite

# bare PACKAGE,...: makes a system in $root.
bare() {
    root=$(mktemp -d)
    chmod 755 "$root"
    trap 'rm -rf "$root"' EXIT
    mmdebstrap --quiet --variant=minbase --include="ca-certificates,$1" "$suite" "$root" >/dev/null
    cp /etc/resolv.conf "$root/etc/resolv.conf"
    # How this machine reaches package indices: settings, and the certificates that it trusts.
    for settings in /etc/pip.conf /root/.config/pip/pip.conf /etc/ssl/certs/ca-certificates.crt; do
        [[ ! -e $settings ]] || install -D "$settings" "$root/$settings"
    done
    mkdir -p "$root/job"
}

# within LANGUAGE PACKAGE: runs job.sh in the system, and prints how long it took.
within() {
    local start=$SECONDS
    env -i PATH=/usr/sbin:/usr/bin:/sbin:/bin HOME=/root LANG=C.UTF-8 "${passed[@]}" chroot "$root" /bin/bash -euo pipefail /job/job.sh
    printf 'only %-8s %-58s main job done %d s after its arrival\n' "$1" "$2" $((SECONDS - start))
    ((SECONDS - start <= 60)) || echo "that is more than a minute" >&2
}

passed=()
for name in http_proxy https_proxy no_proxy HTTP_PROXY HTTPS_PROXY NO_PROXY PIP_INDEX_URL PIP_CERT PIP_TRUSTED_HOST; do
    [[ -z ${!name:-} ]] || passed+=("$name=${!name}")
done

python() {
    bare python3-venv
    local wheel
    wheel=$(echo "$out"/ohmstrain-*manylinux*.whl)
    cp "$wheel" "$root/job"
    cat >"$root/job/job.sh" <<'JOB'
cd /job
python3 -m venv v
v/bin/pip install --quiet ./*.whl
v/bin/ohmstrain -q example -o trace.csv
v/bin/ohmstrain -q calibrate trace.csv --until 200 -o sensor.toml
v/bin/python -c 'import ohmstrain'
v/bin/ohmstrain -q filter trace.csv --sensor sensor.toml -o strain.csv
[[ $(wc -l <strain.csv) -gt 8000 ]]
JOB
    within Python "$(basename "$wheel")"
}

node() {
    bare nodejs,npm
    local package
    package=$(echo "$out"/ohmstrain-*.tgz)
    cp "$package" web/package/try.mjs "$root/job"
    cat >"$root/job/job.sh" <<'JOB'
cd /job
npm init --yes >/dev/null
npm install --silent --no-audit --no-fund --offline ./ohmstrain-*.tgz
node try.mjs
JOB
    within Node "$(basename "$package")"
}

c() {
    bare gcc,libc6-dev
    local library
    library=$(echo "$out"/ohmstrain-c-*.tar.gz)
    cp "$library" "$root/job"
    cat >"$root/job/job.sh" <<'JOB'
cd /job
tar -xzf ohmstrain-c-*.tar.gz
cd ohmstrain-c-*/examples
gcc -std=c99 -O2 filter.c -I../include ../lib/libohmstrain_c.a -lm -lpthread -ldl -o filter
{
    echo time_s,resistance_ohm
    for ((k = 0; k < 400; k++)); do printf '%d.%02d,%d\n' $((k / 20)) $((5 * (k % 20))) $((1600 + 3 * (k % 60))); done
} >readings.csv
[[ $(./filter sensor.toml readings.csv | wc -l) -eq 401 ]]
JOB
    within C "$(basename "$library")"
}

for system in "$@"; do
    case $system in
    python | node | c) ("$system") ;;
    *) echo "expected some of python, node and c, found $system" >&2 && exit 2 ;;
    esac
done
