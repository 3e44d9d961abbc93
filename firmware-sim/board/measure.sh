#!/usr/bin/env bash
# All that README and docs/porting.md say about boards, measured anew: profiles, fault scenarios, 100 scans of both profiles on
# every board, compared bit for bit. About half an hour on a free core.
set -euo pipefail
cd "$(dirname "$0")/../.."
desk() { cargo run --release --quiet --bin sdslam-firmware-sim -- "$@"; }
bash firmware-sim/board/setup.sh
desk profiles
desk faults
for profile in full landmark; do
    bash firmware-sim/board/run.sh --profile $profile --scans 100
done
