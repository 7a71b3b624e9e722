//! Compiles the computations for the browser and puts them, the style and the scripts into one file, `dist/index.html`.

use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, ExitCode};

use flate2::Compression;
use flate2::write::GzEncoder;

const TARGET: &str = "wasm32-unknown-unknown";
/// In the order of their dependencies.
const SCRIPTS: [&str; 8] = [
    "border.js",
    "drawing.js",
    "state.js",
    "controls.js",
    "friction.js",
    "formula.js",
    "main.js",
    "tasks.js",
];
/// Largest size of the page in bytes.
const LIMIT: usize = 2_000_000;

fn main() -> ExitCode {
    match build() {
        Ok(told) => {
            println!("{told}");
            ExitCode::SUCCESS
        }
        Err(e) => {
            eprintln!("error: {e}");
            ExitCode::FAILURE
        }
    }
}

fn build() -> Result<String, String> {
    let web = Path::new(env!("CARGO_MANIFEST_DIR"))
        .parent()
        .ok_or("this program lies in no folder")?;
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| web.join("target"), Into::into);
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    let status = Command::new(cargo)
        .args([
            "build",
            "--release",
            "--lib",
            "--target",
            TARGET,
            "--package",
            "semismooth-web",
        ])
        .arg("--manifest-path")
        .arg(web.join("Cargo.toml"))
        .arg("--target-dir")
        .arg(&target)
        .status()
        .map_err(|e| format!("cargo does not start: {e}"))?;
    if !status.success() {
        return Err(format!(
            "cargo failed; is the target installed (rustup target add {TARGET})?"
        ));
    }
    let computations = target.join(TARGET).join("release/semismooth_web.wasm");
    let computations = fs::read(&computations).map_err(|e| format!("{}: {e}", computations.display()))?;
    let packed = packed(&computations).map_err(|e| format!("the computations cannot be packed: {e}"))?;
    let part = |name: &str| {
        let path = web.join("page").join(name);
        fs::read_to_string(&path).map_err(|e| format!("{}: {e}", path.display()))
    };
    let mut script = String::from("'use strict';\n");
    for name in SCRIPTS {
        script.push_str(&part(name)?);
    }
    if script.contains("</script") {
        return Err("a script ends itself".to_owned());
    }
    let page = part("index.html")?
        .replace("/* page.css */", part("page.css")?.trim_end())
        .replace(
            "/* semismooth.wasm */",
            &format!("const packedComputations = '{}';", base64(&packed)),
        )
        .replace("/* page.js */", &script);
    let size = page.len();
    if size > LIMIT {
        return Err(format!("the page has {size} bytes; {LIMIT} are allowed"));
    }
    let folder = web.join("dist");
    let file = folder.join("index.html");
    fs::create_dir_all(&folder).map_err(|e| format!("{}: {e}", folder.display()))?;
    fs::write(&file, page).map_err(|e| format!("{}: {e}", file.display()))?;
    Ok(format!("{}: {size} bytes", file.display()))
}

/// Browsers unpack gzip.
fn packed(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes)?;
    encoder.finish()
}

/// RFC 4648.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let bits = three.iter().fold(0, |bits, b| bits << 8 | u32::from(*b)) << (8 * (3 - three.len()));
        for k in 0..4 {
            match k <= three.len() {
                true => text.push(char::from(DIGITS[(bits >> (18 - 6 * k) & 63) as usize])),
                false => text.push('='),
            }
        }
    }
    text
}
