//! Gives the shared library the name that programs are linked against: it changes with the ABI and with nothing else.

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // Must be `SPL_ABI_VERSION`; a test compares them.
    let abi = 1;
    let system = std::env::var("CARGO_CFG_TARGET_OS").unwrap_or_default();
    if system == "linux" {
        println!("cargo:rustc-cdylib-link-arg=-Wl,-soname,libspikelane.so.{abi}");
    } else if system == "macos" {
        println!("cargo:rustc-cdylib-link-arg=-Wl,-install_name,@rpath/libspikelane.{abi}.dylib");
    }
}
