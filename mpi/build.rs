//! Lets the program find the library of MPI when it runs, wherever that is installed, and builds the door to PETSc if the
//! feature `petsc` asks for it.

fn main() {
    println!("cargo:rerun-if-env-changed=MPICC");
    // The crate `mpi` reports why there is no MPI.
    let Ok(mpi) = build_probe_mpi::probe() else { return };
    mpi.lib_paths.iter().for_each(|path| find_at_run_time(path));
    #[cfg(feature = "petsc")]
    petsc(&mpi);
}

fn find_at_run_time(path: &std::path::Path) {
    println!("cargo:rustc-link-arg=-Wl,-rpath,{}", path.display());
}

/// Compiles `petsc.c` with the headers of MPI that the program uses. Those of PETSc refuse another MPI than their own.
#[cfg(feature = "petsc")]
fn petsc(mpi: &build_probe_mpi::Library) {
    println!("cargo:rerun-if-changed=src/petsc.c");
    let names = ["PETSc", "petsc"];
    let found =
        names.iter().find_map(|name| pkg_config::Config::new().atleast_version("3.15").probe(name).ok());
    let Some(petsc) = found else {
        println!(
            "cargo:error=the feature `petsc` needs PETSc 3.15 or later: install it (Debian: libpetsc-real-dev), or name the \
             directory of its PETSc.pc in PKG_CONFIG_PATH"
        );
        return;
    };
    petsc.link_paths.iter().for_each(|path| find_at_run_time(path));
    cc::Build::new()
        .file("src/petsc.c")
        .includes(&mpi.include_paths)
        .includes(&petsc.include_paths)
        .warnings_into_errors(false)
        .compile("variational_petsc");
}
