#!/usr/bin/env bash
# Two nodes of the service and HAProxy before them, on this machine: `make cluster`. Ctrl-C ends all three.
#   CLUSTER_PORT=8000 CLUSTER_FOLDER=cluster CLUSTER_KEYS=keys service/deploy/cluster.sh PYTHON
set -euo pipefail
python=${1:?the interpreter of an environment with the service}
port=${CLUSTER_PORT:-8000} folder=${CLUSTER_FOLDER:-cluster}
PATH=$PATH:/usr/sbin
command -v haproxy >/dev/null || {
    echo "make cluster: HAProxy is missing; Debian's package is haproxy" >&2
    exit 1
}
trap 'kill $(jobs -p) 2>/dev/null; wait' EXIT
trap 'exit 0' INT TERM
for node in 00 01; do
    peer=$([ $node = 00 ] && echo 01 || echo 00)
    "$python" -m hybridmpm_service --port $((port + 1 + 10#$node)) --node $node --state-folder "$folder/$node" \
        --peers "$peer=http://127.0.0.1:$((port + 1 + 10#$peer))" ${CLUSTER_KEYS:+--keys "$CLUSTER_KEYS"} &
done
export NODE_00=127.0.0.1:$((port + 1)) NODE_01=127.0.0.1:$((port + 2)) LISTEN=127.0.0.1:$port
echo "the page of both nodes is on http://$LISTEN"
haproxy -db -f "$(dirname "$0")/common.cfg" -f "$(dirname "$0")/cluster.cfg" &
wait -n
