# Where Rust's core library for the Cortex-R5 comes from; sourced by setup.sh and run.sh.
#
# `r5_core BUILD` prints "target" when the toolchain has it, or the folder of the library's source when it must be built
# from that (source of the toolchain's very version); it fails when neither is there. `r5_get BUILD` tries to get one.

r5_target=armv7r-none-eabihf

r5_core() {
    local build=$1 folder
    if [ -d "$(rustc --print target-libdir --target $r5_target)" ]; then
        echo target
        return
    fi
    for folder in "$(rustc --print sysroot)/lib/rustlib/src/rust" "$build/rust-src-$(r5_version)"; do
        if [ -f "$folder/library/core/src/lib.rs" ]; then
            echo "$folder/library"
            return
        fi
    done
    return 1
}

r5_version() { rustc --version | awk '{ print $2 }'; }

# By rustup, or from Debian's package of the same version, unpacked into the build folder.
r5_get() {
    local build=$1
    timeout 120 rustup target add $r5_target >/dev/null 2>&1 && return
    timeout 120 rustup component add rust-src >/dev/null 2>&1 && return
    r5_get_debian "$build/rust-src-$(r5_version)"
}

r5_get_debian() (
    folder=$1
    command -v apt-get >/dev/null && command -v dpkg >/dev/null || exit 1
    apt=$(mktemp -d) && trap 'rm -rf "$apt"' EXIT
    mkdir -p "$apt/lists/partial" "$apt/cache/archives/partial"
    mirror=http://deb.debian.org/debian
    printf 'deb %s %s main\n' $mirror trixie $mirror trixie-backports >"$apt/sources.list"
    cat >"$apt/apt.conf" <<CONF
Dir::Etc::sourcelist "$apt/sources.list";
Dir::Etc::sourceparts "/dev/null";
Dir::State::lists "$apt/lists";
Dir::Cache "$apt/cache";
CONF
    export APT_CONFIG=$apt/apt.conf
    apt-get update -qq >/dev/null 2>&1 || exit 1
    version=$(apt-cache madison rust-src | awk -v v="$(r5_version)" 'index($3, v "+") == 1 { print $3; exit }')
    [ -n "$version" ] || exit 1
    cd "$apt" && apt-get download -qq "rust-src=$version" >/dev/null 2>&1 || exit 1
    dpkg -x rust-src_*.deb unpacked || exit 1
    mkdir -p "$folder" && cp -r "unpacked/usr/src/rustc-$(r5_version)/library" "$folder/"
)
