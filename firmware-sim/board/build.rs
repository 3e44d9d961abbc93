//! Chooses the processor's module, and hands the linker the script of its board.

use std::path::PathBuf;
use std::{env, fs};

fn main() {
    let out = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets it"));
    println!("cargo:rustc-link-search={}", out.display());
    println!("cargo:rerun-if-changed=link");
    println!("cargo:rustc-check-cfg=cfg(processor, values(\"cortex_m\", \"cortex_a\", \"cortex_r\"))");
    let put =
        |name: &str, text: &[u8]| fs::write(out.join(name), text).expect("the build folder can be written");
    let target = env::var("TARGET").expect("cargo sets it");
    let (processor, script) = match target.split_once('-').map(|(processor, _)| processor) {
        // link.x is cortex-m-rt's; it includes memory.x, as ours does.
        Some("thumbv7em") => ("cortex_m", "link.x"),
        Some("aarch64") => ("cortex_a", "flat.x"),
        Some("armv7r") => ("cortex_r", "flat.x"),
        _ => return println!("cargo:warning=no board with this processor"),
    };
    put("flat.x", include_bytes!("link/flat.x"));
    put(
        "memory.x",
        match processor {
            "cortex_m" => include_bytes!("link/mps2-an500.x"),
            "cortex_a" => include_bytes!("link/virt.x"),
            _ => include_bytes!("link/versatileab.x"),
        },
    );
    println!("cargo:rustc-cfg=processor=\"{processor}\"");
    println!("cargo:rustc-link-arg-bin=vehicle=-T{script}");
    println!("cargo:rustc-link-arg-bin=vehicle=-Tdefmt.x");
    // The proof keeps its hot path, and what that needs, and nothing else.
    println!("cargo:rustc-link-arg-bin=proof=--entry=hot_path");
}
