//! Finds PETSc by pkg-config and MPI by its compiler wrapper, and builds the shim, in which the C compiler checks the types that
//! `src/ffi.rs` declares.

use std::path::PathBuf;
use std::process::Command;

const MISSING: &str = "PETSc (3.16 or newer) was not found by pkg-config. On Debian and Ubuntu: apt-get install --no-install-recommends \
                       petsc-dev libopenmpi-dev openmpi-bin pkg-config gcc. For a build of your own let PKG_CONFIG_PATH name the folder of \
                       PETSc.pc, $PETSC_DIR/$PETSC_ARCH/lib/pkgconfig";

fn main() {
    println!("cargo::rerun-if-changed=shim.c");
    println!("cargo::rerun-if-env-changed=MPICC");
    println!("cargo::rustc-check-cfg=cfg(petsc_int64)");
    if let Err(what) = build() {
        println!("cargo::error={what}");
    }
}

fn build() -> Result<(), String> {
    let probe = |name: &str| {
        pkg_config::Config::new()
            .atleast_version("3.16")
            .cargo_metadata(false)
            .probe(name)
    };
    let petsc = probe("PETSc")
        .or_else(|_| probe("petsc"))
        .map_err(|e| format!("{MISSING}. {}", e.to_string().lines().next().unwrap_or_default()))?;
    let settings = settings(&petsc.include_paths)?;
    if settings.contains("PETSC_USE_COMPLEX ") {
        return Err("this PETSc computes with complex numbers; one with real numbers is needed".into());
    }
    if !settings.contains("PETSC_USE_REAL_DOUBLE ") {
        return Err("this PETSc is not in double precision".into());
    }
    if settings.contains("PETSC_USE_64BIT_INDICES ") {
        println!("cargo::rustc-cfg=petsc_int64");
    }
    let mpicc = std::env::var("MPICC").unwrap_or("mpicc".into());
    let shown = Command::new(&mpicc).arg("-show").output().map_err(|e| {
        format!("{mpicc}: {e}. The compiler of MPI is needed (libopenmpi-dev); MPICC names another one")
    })?;
    cc::Build::new()
        .compiler(&mpicc)
        .file("shim.c")
        .includes(&petsc.include_paths)
        .try_compile("semismooth_petsc_shim")
        .map_err(|e| e.to_string())?;
    for path in &petsc.link_paths {
        println!("cargo::rustc-link-search=native={}", path.display());
    }
    for lib in &petsc.libs {
        println!("cargo::rustc-link-lib={lib}");
    }
    // Link MPI as its compiler wrapper does.
    for flag in String::from_utf8_lossy(&shown.stdout).split_whitespace() {
        if let Some(path) = flag.strip_prefix("-L") {
            println!("cargo::rustc-link-search=native={path}");
        } else if let Some(lib) = flag.strip_prefix("-l") {
            println!("cargo::rustc-link-lib={lib}");
        }
    }
    Ok(())
}

/// The settings with which PETSc was built.
fn settings(folders: &[PathBuf]) -> Result<String, String> {
    let texts = folders
        .iter()
        .map(|p| std::fs::read_to_string(p.join("petscconf.h")));
    let text = texts
        .flatten()
        .next()
        .ok_or("petscconf.h was not found beside the headers of PETSc")?;
    Ok(text)
}
