#!/usr/bin/env bash
# Builds the WebAssembly modules of playing pages, for scenes in 2D and in 3D, with relaxed vector instructions and
# without: `make web`. It takes a compiler for wasm32-unknown-unknown with the source of its standard library:
#   Debian: apt-get install rustc-web cargo-web rust-web-src lld-19
#   rustup: rustup target add wasm32-unknown-unknown && rustup component add rust-src
set -euo pipefail
cd "$(dirname "$0")/../.."

if [ -d /usr/lib/rustlib/src/rust/library ] && command -v wasm-ld-19 >/dev/null; then
    export PATH=/usr/bin:/bin RUSTC=/usr/bin/rustc CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER=wasm-ld-19
elif ! rustc --print target-libdir --target wasm32-unknown-unknown 2>/dev/null | xargs -r test -d; then
    echo "make web: no compiler for wasm32-unknown-unknown; rust/web/build.sh says which packages have one" >&2
    exit 1
fi

out=python/hybridmpm/playing
# The standard library is built anew to leave out its messages of panics. Stable compilers need the variable for that.
export RUSTC_BOOTSTRAP=1
for kind in relaxed exact; do
    features=+simd128
    [ $kind = relaxed ] && features=$features,+relaxed-simd
    export RUSTFLAGS="-Zunstable-options -Cpanic=immediate-abort -Cstrip=symbols -Ctarget-feature=$features"
    # Exact modules are for few browsers, and each page carries both: they are built for size.
    [ $kind = exact ] && export CARGO_PROFILE_RELEASE_OPT_LEVEL=s
    export CARGO_TARGET_DIR=${WEB_TARGET_DIR:-target/web}/$kind
    for scenes in plane space; do
        flags=()
        [ $scenes = space ] && flags=(--features space)
        cargo build --quiet --release --locked --package hybridmpm-web "${flags[@]}" \
            --target wasm32-unknown-unknown -Z build-std=std,panic_abort
        name=$scenes
        [ $kind = exact ] && name=$name-exact
        gzip -9 --no-name --stdout "$CARGO_TARGET_DIR/wasm32-unknown-unknown/release/web.wasm" >"$out/$name.wasm.gz"
    done
done
python3 rust/web/sources.py >"$out/modules.txt"
ls -l "$out"/*.wasm.gz
