#!/usr/bin/env bash
# install.sh PREFIX [FOLDER]: installs headers, libraries, a CMake package and a pkg-config file in PREFIX.
# FOLDER contains compiled libraries. Without FOLDER, the script compiles optimized libraries.
set -euo pipefail
prefix=${1:?usage: install.sh PREFIX [FOLDER]}
here=$(cd "$(dirname "$0")" && pwd)
mkdir -p "$prefix"
prefix=$(cd "$prefix" && pwd)
libdir=$prefix/${LIBDIR:-lib}

if [ $# -ge 2 ]; then
    built=$(cd "$2" && pwd)
else
    # A build of this package alone selects fewer features than a build of the workspace.
    cargo build --release --manifest-path "$here/Cargo.toml" -p spikelane-c --lib
    built=$(cd "${CARGO_TARGET_DIR:-$here/../../target}/release" && pwd)
fi

version=$(sed -n 's/^version = "\(.*\)"/\1/p' "$here/Cargo.toml" | head -1)
abi=$(sed -n 's/^#define SPL_ABI_VERSION //p' "$here/include/spikelane.h")
install -d "$prefix/include" "$libdir/pkgconfig" "$libdir/cmake/spikelane"
install -m 644 "$here/include/spikelane.h" "$here/include/spikelane.hpp" "$prefix/include/"
install -m 644 "$built/libspikelane_c.a" "$libdir/libspikelane.a"
case "$(uname)" in
Darwin)
    shared=libspikelane.$abi.dylib
    link=libspikelane.dylib
    install -m 755 "$built/libspikelane_c.dylib" "$libdir/$shared"
    private="-lSystem -liconv -lm"
    ;;
*)
    shared=libspikelane.so.$abi
    link=libspikelane.so
    install -m 755 "$built/libspikelane_c.so" "$libdir/$shared"
    private="-lgcc_s -lutil -lrt -lpthread -lm -ldl"
    ;;
esac
ln -sf "$shared" "$libdir/$link"
fill() {
    sed -e "s|@PREFIX@|$prefix|g" -e "s|@LIBDIR@|$libdir|g" -e "s|@VERSION@|$version|g" -e "s|@ABI@|$abi|g" \
        -e "s|@SHARED@|$shared|g" -e "s|@PRIVATE@|$private|g" -e "s|@PRIVATE_LIST@|${private// /;}|g" "$1"
}
fill "$here/cmake/spikelane.pc.in" >"$libdir/pkgconfig/spikelane.pc"
fill "$here/cmake/spikelaneConfig.cmake.in" >"$libdir/cmake/spikelane/spikelaneConfig.cmake"
fill "$here/cmake/spikelaneConfigVersion.cmake.in" >"$libdir/cmake/spikelane/spikelaneConfigVersion.cmake"
echo "spikelane $version, ABI $abi, in $prefix"
