//! Hands the linker the script of the board.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rerun-if-changed=link");
    let put =
        |name: &str, text: &[u8]| fs::write(out.join(name), text).expect("the build folder can be written");
    match env::var("CARGO_CFG_TARGET_ARCH").as_deref() {
        // cortex-m-rt's script includes memory.x.
        Ok("arm") => {
            put("memory.x", include_bytes!("link/mps2-an500.x"));
            println!("cargo:rustc-link-arg-bin=vehicle=-Tlink.x");
        }
        Ok("aarch64") => {
            put("virt.x", include_bytes!("link/virt.x"));
            println!("cargo:rustc-link-arg-bin=vehicle=-Tvirt.x");
        }
        _ => println!("cargo:warning=no board with this processor"),
    }
    println!("cargo:rustc-link-arg-bin=vehicle=-Tdefmt.x");
    // The proof keeps its hot path, and what that needs, and nothing else.
    println!("cargo:rustc-link-arg-bin=proof=--entry=hot_path");
}
