#!/bin/sh
# Builds the modules of bake/ as wasm.sh builds the run-time: with the wasm32 target of the toolchain if it is installed, otherwise
# with a compiler that builds the standard library from its sources (Debian: rustc-web rust-web-src lld-19). Then optimizes them.
#
#   first    enfilade-bake.wasm: the formats that most people have
#   threads  enfilade-bake-threads.wasm: the same, on several threads
#   all      enfilade-bake-all.wasm: more formats
#
# BAKE_MODULES chooses some. BAKE_PROFILE=gate builds sooner what runs slower, and only the first: each takes minutes. Releases build
# and test all.
set -eu
here=$(cd "$(dirname "$0")/.." && pwd)
target=${CARGO_TARGET_DIR:-$here/../../target/web}
cd "$here/bake"
profile=${BAKE_PROFILE:-release}
# Trees of planes are deep. Four numbers at a time, with the same bits as one by one.
plain="-C link-arg=-zstack-size=8388608 -C target-feature=+simd128"
# One memory for all threads, which the page makes; each has a stack and thread-local storage of its own there.
shared="$plain,+atomics,+bulk-memory,+mutable-globals -C link-arg=--shared-memory -C link-arg=--import-memory"
shared="$shared -C link-arg=--initial-memory=67108864 -C link-arg=--max-memory=4294967296"
for name in __wasm_init_tls __tls_size __tls_align __stack_pointer; do shared="$shared -C link-arg=--export=$name"; done
features="--enable-bulk-memory --enable-sign-ext --enable-mutable-globals --enable-nontrapping-float-to-int"
features="$features --enable-reference-types --enable-multivalue --enable-simd --enable-threads"
linker=
for name in wasm-ld wasm-ld-19 wasm-ld-20 wasm-ld-21; do
  if [ -z "$linker" ]; then linker=$(command -v $name || true); fi
done
has_target() { [ -d "$(rustc --print sysroot)/lib/rustlib/wasm32-unknown-unknown/lib" ]; }
build() { cargo rustc --lib --crate-type cdylib --locked --profile "$profile" --target wasm32-unknown-unknown "$@"; }
build_std() {
  CARGO_TARGET_WASM32_UNKNOWN_UNKNOWN_LINKER="$linker" RUSTC="${WASM_RUSTC:-/usr/bin/rustc}" RUSTC_BOOTSTRAP=1 \
    build "$@" -Z build-std=std,panic_abort
}
mkdir -p "$here/dist"
if [ "$profile" = release ]; then modules="first threads all"; else modules=first; fi
for module in ${BAKE_MODULES:-$modules}; do
  name=enfilade-bake-$module.wasm
  export RUSTFLAGS="$plain" CARGO_TARGET_DIR="$target"
  case $module in
    first)
      name=enfilade-bake.wasm
      if has_target; then build; else build_std; fi ;;
    all)
      if has_target; then build --features all; else build_std --features all; fi ;;
    threads)
      export RUSTFLAGS="$shared" CARGO_TARGET_DIR="$target/threads"
      # The toolchain's standard library has no threads.
      build_std ;;
  esac
  built="$CARGO_TARGET_DIR/wasm32-unknown-unknown/$profile/enfilade_web_bake.wasm"
  if [ "$profile" = release ] && command -v wasm-opt >/dev/null; then
    wasm-opt -O2 $features "$built" -o "$here/dist/$name"
  else
    cp "$built" "$here/dist/$name"
  fi
  echo "$name: $(wc -c <"$here/dist/$name") bytes, $(gzip -9c "$here/dist/$name" | wc -c) gzipped"
done
