#!/usr/bin/env bash
# Gets what run.sh needs and is missing: QEMU, the bare-metal targets, defmt-print. Says what it could not get; the exit code
# is 3 then. With --r5 also the core library for the Cortex-R5, where it can be had.
set -uo pipefail
cd "$(dirname "$0")/../.."
# shellcheck source=firmware-sim/board/r5_core.sh
. firmware-sim/board/r5_core.sh
build=$(realpath -m "${CARGO_TARGET_DIR:-target}")/board
missing=()

have() { command -v "$1" >/dev/null; }
if ! have qemu-system-arm || ! have qemu-system-aarch64; then
    if have apt-get && [ "$(id -u)" = 0 ]; then
        apt-get update -qq && apt-get install -y -qq --no-install-recommends qemu-system-arm >/dev/null
    fi
fi
have qemu-system-arm || missing+=("qemu-system-arm (Debian, Ubuntu: apt-get install qemu-system-arm)")
have qemu-system-aarch64 || missing+=("qemu-system-aarch64 (in the same package)")

for target in thumbv7em-none-eabihf aarch64-unknown-none; do
    [ -d "$(rustc --print target-libdir --target $target)" ] || rustup target add $target ||
        missing+=("Rust's core library for $target (rustup target add $target)")
done

have defmt-print || [ -x "${CARGO_HOME:-$HOME/.cargo}/bin/defmt-print" ] ||
    cargo install --quiet --locked defmt-print || missing+=("defmt-print (cargo install --locked defmt-print)")
have readelf || missing+=("readelf (binutils)")

if [ "${1:-}" = --r5 ]; then
    if core=$(r5_core "$build") || { r5_get "$build" && core=$(r5_core "$build"); }; then
        echo "Cortex-R5: core library from $core"
    else
        missing+=("the core library for the Cortex-R5 (rustup target add $r5_target, or its source: rustup component add" \
            "rust-src, or Debian's rust-src $(r5_version))")
    fi
fi

if [ ${#missing[@]} -gt 0 ]; then
    printf 'not there, and could not be got: %s\n' "${missing[@]}" >&2
    exit 3
fi
echo "QEMU, targets and defmt-print are there"
