//! Lets the program find the library of MPI when it runs, wherever that is installed.

fn main() {
    // The crate `mpi` reports why there is no MPI.
    let found = build_probe_mpi::probe().map(|library| library.lib_paths).unwrap_or_default();
    for path in found {
        println!("cargo:rustc-link-arg=-Wl,-rpath,{}", path.display());
    }
    println!("cargo:rerun-if-env-changed=MPICC");
}
