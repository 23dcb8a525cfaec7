#!/bin/sh
# Builds enfilade-bake.wasm from bake/, as wasm.sh builds the run-time: with the wasm32 target of the toolchain if it is
# installed, otherwise with a compiler that builds the standard library from its sources (Debian: rustc-web rust-web-src
# lld-19). Then optimizes it. BAKE_PROFILE=gate builds sooner what runs slower, and optimizes no further.
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
target=${CARGO_TARGET_DIR:-$here/../../target/web}
cd "$here/bake"
export CARGO_TARGET_DIR="$target"
profile=${BAKE_PROFILE:-release}
build="rustc --lib --crate-type cdylib --locked --profile $profile"
# Trees of planes are deep. Four numbers at a time, with the same bits as one by one.
flags="-C link-arg=-zstack-size=8388608 -C target-feature=+simd128"
if [ -d "$(rustc --print sysroot)/lib/rustlib/wasm32-unknown-unknown/lib" ]; then
  RUSTFLAGS="$flags" cargo $build --target wasm32-unknown-unknown
else
  rustc=${WASM_RUSTC:-/usr/bin/rustc}
  linker=
  for name in wasm-ld wasm-ld-19 wasm-ld-20 wasm-ld-21; do
    if [ -z "$linker" ]; then linker=$(command -v $name || true); fi
  done
  export CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER="$linker"
  RUSTC="$rustc" RUSTC_BOOTSTRAP=1 RUSTFLAGS="$flags" cargo $build \
    --target wasm32-unknown-unknown -Z build-std=std,panic_abort
fi
features="--enable-bulk-memory --enable-sign-ext --enable-mutable-globals --enable-nontrapping-float-to-int"
features="$features --enable-reference-types --enable-multivalue --enable-simd"
built="$target/wasm32-unknown-unknown/$profile/enfilade_web_bake.wasm"
mkdir -p "$here/dist"
if [ "$profile" = release ] && command -v wasm-opt >/dev/null; then
  wasm-opt -O2 $features "$built" -o "$here/dist/enfilade-bake.wasm"
else
  cp "$built" "$here/dist/enfilade-bake.wasm"
fi
echo "enfilade-bake.wasm: $(wc -c <"$here/dist/enfilade-bake.wasm") bytes, $(gzip -9c "$here/dist/enfilade-bake.wasm" | wc -c) gzipped"
