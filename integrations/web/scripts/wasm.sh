#!/bin/sh
# Builds enfilade.wasm from ../abi: with the wasm32 target of the toolchain if it is installed, otherwise with a compiler
# that builds the standard library from its sources (Debian: rustc-web rust-web-src lld-19). Then shrinks it.
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
target=${CARGO_TARGET_DIR:-$here/../../target/web}
cd "$here/../abi"
export CARGO_TARGET_DIR="$target"
# Cargo optimizes across crates only where no rlib is made.
build="rustc --lib --crate-type cdylib --locked --profile web"
# No function is exported but ours; floats stay exact.
flags="-C link-arg=-zstack-size=262144"
if [ -d "$(rustc --print sysroot)/lib/rustlib/wasm32-unknown-unknown/lib" ]; then
  RUSTFLAGS="$flags" cargo $build --target wasm32-unknown-unknown
else
  rustc=${WASM_RUSTC:-/usr/bin/rustc}
  # A panic traps at once: no texts of places in the source, no formatting of what nobody reads.
  small="-Z unstable-options -C panic=immediate-abort -Z location-detail=none"
  linker=
  for name in wasm-ld wasm-ld-19 wasm-ld-20 wasm-ld-21; do
    if [ -z "$linker" ]; then linker=$(command -v $name || true); fi
  done
  export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER="$linker"
  RUSTC="$rustc" RUSTC_BOOTSTRAP=1 RUSTFLAGS="$flags $small" cargo $build \
    --target wasm32-unknown-unknown -Z build-std=std,panic_abort -Z build-std-features=optimize_for_size
fi
# The features that the compiler uses by default, which browsers have had for years; no newer ones.
features="--enable-bulk-memory --enable-sign-ext --enable-mutable-globals --enable-nontrapping-float-to-int"
features="$features --enable-reference-types --enable-multivalue"
built="$target/wasm32-unknown-unknown/web/enfilade_abi.wasm"
mkdir -p "$here/dist"
if command -v wasm-opt >/dev/null; then
  wasm-opt -Oz $features --converge "$built" -o "$here/dist/enfilade.wasm"
else
  cp "$built" "$here/dist/enfilade.wasm"
fi
echo "enfilade.wasm: $(wc -c <"$here/dist/enfilade.wasm") bytes, $(gzip -9c "$here/dist/enfilade.wasm" | wc -c) gzipped"
