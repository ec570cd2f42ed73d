# Sourced by the tools: sets up what building and running need on Debian 12, quietly and only where it is missing.
#
# Defines `root` (the clone), `rust_needed` (from Cargo.toml) and the functions `setup`, `built` and `fail`.
# shellcheck shell=bash

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd)"
rust_needed="$(sed -n 's/^rust-version *= *"\(.*\)"/\1/p' "$root/Cargo.toml")"

# Loader, CPU driver (lavapipe) and validation layer; the GLSL compiler that build.rs links; the C++ compiler of xatlas.
packages=(
    libvulkan1 mesa-vulkan-drivers vulkan-validationlayers
    libshaderc-dev glslang-dev spirv-tools
    gcc g++ libc6-dev pkg-config
)

# What a window needs on X11 beside the C library, and what tests drive one with.
window_packages=(libxkbcommon-x11-0 libxcursor1 libxi6 libxrandr2 libx11-xcb1)
test_packages=("${window_packages[@]}" xvfb xdotool)

# A relative target directory is meant from the clone, because that is where cargo runs.
case "${CARGO_TARGET_DIR:-}" in
    "") target="$root/target" ;;
    /*) target="$CARGO_TARGET_DIR" ;;
    *) target="$root/$CARGO_TARGET_DIR" ;;
esac
export CARGO_TARGET_DIR="$target"

# say TEXT...: a line to the person, off the tool's own output.
say() { printf 'rebake: %s\n' "$*" >&2; }

# fail TEXT...: says what is wrong and ends.
fail() {
    say "$@"
    exit 1
}

# quietly COMMAND...: runs it, and shows what it printed only if it fails.
quietly() {
    local log status=0
    log="$(mktemp)"
    "$@" >"$log" 2>&1 </dev/null || status=$?
    if [ "$status" != 0 ]; then cat "$log" >&2; fi
    rm -f "$log"
    return "$status"
}

# as_root COMMAND...: runs it with the rights that apt needs.
as_root() {
    if [ "$(id -u)" = 0 ]; then
        "$@"
    elif command -v sudo >/dev/null; then
        sudo "$@"
    else
        return 127
    fi
}

# apt-get that asks nothing, says little and waits for its lock.
apt=(env DEBIAN_FRONTEND=noninteractive apt-get -qq -o Dpkg::Use-Pty=0 -o DPkg::Lock::Timeout=300)

# installed PACKAGE: is it installed?
installed() { [ "$(dpkg-query -W -f '${db:Status-Status}' "$1" 2>/dev/null)" = installed ]; }

# need PACKAGE...: installs those that are missing.
need() {
    local missing=() package
    command -v dpkg-query >/dev/null || return 0 # not Debian: the README lists what the build needs
    for package in "$@"; do installed "$package" || missing+=("$package"); done
    [ "${#missing[@]}" = 0 ] && return 0
    say "installing ${missing[*]}"
    local install=("${apt[@]}" install -y --no-install-recommends "${missing[@]}")
    # The package lists are fetched only when the ones at hand do not do.
    as_root "${install[@]}" >/dev/null 2>&1 </dev/null && return 0
    quietly as_root "${apt[@]}" update || say "could not refresh apt's package lists"
    quietly as_root "${install[@]}" ||
        fail "could not install ${missing[*]}: install them by hand (as root: apt-get install ${missing[*]}), then run this again"
}

# at_least VERSION: is that version of Rust at least the one that Cargo.toml asks for?
at_least() { [ "$(printf '%s\n' "$rust_needed" "$1" | sort -V | head -n1)" = "$rust_needed" ]; }

# new_enough: is the cargo found at least the one that Cargo.toml asks for?
new_enough() {
    local found
    found="$(cd "$root" && cargo --version 2>/dev/null)" || return 1
    at_least "$(cut -d' ' -f2 <<<"$found")"
}

# Debian 12 carries a current Rust beside its own old one, for the browsers it builds.
rust_packages=(rustc-web cargo-web rustfmt-web rust-web-clippy)

# debian_offers: the version of that Rust that apt's package lists name, or 0.
debian_offers() {
    local offered
    offered="$(apt-cache policy cargo-web 2>/dev/null | sed -n 's/^ *Candidate: *\([0-9][0-9.]*\).*/\1/p')"
    printf '%s\n' "${offered:-0}"
}

# debian_rust: Rust from Debian, where Debian's is new enough and takes the place of nothing installed.
debian_rust() {
    command -v apt-cache >/dev/null || return 1
    at_least "$(debian_offers)" || as_root "${apt[@]}" update >/dev/null 2>&1 </dev/null || return 1
    at_least "$(debian_offers)" || return 1
    say "installing Rust $(debian_offers) from Debian"
    as_root "${apt[@]}" install -y --no-install-recommends --no-remove "${rust_packages[@]}" >/dev/null 2>&1 </dev/null && new_enough
}

# need_rust: a cargo that is new enough, from the path, from rustup's home, or fresh, from Debian or by rustup.
need_rust() {
    new_enough && return 0
    PATH="${CARGO_HOME:-$HOME/.cargo}/bin:$PATH"
    export PATH
    new_enough && return 0
    if ! command -v rustup >/dev/null && debian_rust; then
        return 0
    elif command -v rustup >/dev/null; then
        say "installing the stable Rust toolchain ($rust_needed or newer is needed)"
        quietly rustup toolchain install stable --profile minimal --no-self-update ||
            fail "rustup could not install it: run 'rustup toolchain install stable', then run this again"
        export RUSTUP_TOOLCHAIN=stable
    else
        say "installing Rust by rustup ($rust_needed or newer is needed)"
        need ca-certificates curl
        local script
        script="$(mktemp)"
        quietly curl --proto '=https' --tlsv1.2 -fsSL https://sh.rustup.rs -o "$script" &&
            quietly sh "$script" -y --profile minimal --no-modify-path --default-toolchain stable ||
            fail "could not install Rust: see https://rustup.rs, then run this again"
        rm -f "$script"
    fi
    new_enough || fail "cargo $rust_needed or newer is needed, $(cargo --version 2>/dev/null || echo none) was found: run 'rustup update stable'"
}

# need_components NAME...: parts of the Rust toolchain that checks need.
need_components() {
    local name missing=()
    for name in "$@"; do (cd "$root" && cargo "$name" --version) >/dev/null 2>&1 || missing+=("${name/fmt/rustfmt}"); done
    [ "${#missing[@]}" = 0 ] && return 0
    command -v rustup >/dev/null || fail "cargo lacks ${missing[*]}: install them beside it"
    quietly rustup component add "${missing[@]}" || fail "could not add ${missing[*]}: run 'rustup component add ${missing[*]}'"
}

# setup: everything that a build and a run need.
setup() {
    need "${packages[@]}"
    need_rust
}

# built BINARY: builds it in release and prints where it lies; what cargo says is shown only if it fails.
built() {
    [ -x "$target/release/$1" ] || say "building (some minutes the first time)"
    # From the clone's root: cargo looks for .cargo/config.toml upwards from where it runs.
    (cd "$root" && quietly cargo build --release --quiet --bin "$1") || fail "the build failed"
    printf '%s\n' "$target/release/$1"
}
