#!/usr/bin/env bash
# Installs Debian packages, as root: one call after another, whoever else calls it meanwhile.
#
#   apt.sh PACKAGE...
set -euo pipefail
exec 9>/tmp/ohmstrain-apt.lock
flock 9
export DEBIAN_FRONTEND=noninteractive
apt-get -q update >/dev/null
apt-get -q install -y --no-install-recommends "$@" >/dev/null
