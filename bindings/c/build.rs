//! Sets the file name under which programs load the shared library. The name changes only with the ABI version.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // Must equal `SPL_ABI_VERSION`; a test compares them.
    let abi = 1;
    let system = std::env::var("CARGO_CFG_TARGET_OS").unwrap_or_default();
    if system == "linux" {
        println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libspikelane.so.{abi}");
    } else if system == "macos" {
        println!("cargo:rustc-cdylib-link-arg=-Wl,-install_name,@rpath/libspikelane.{abi}.dylib");
    }
}
