//! Selects the vector instructions that the kernels use.

use pulp::Arch;

use crate::error::FemError;

/// An instruction set of the processor. Results on different sets differ in the last digits (fused multiply–add or
/// not), so compare bits only between runs on the same set.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum InstructionSet {
    /// The widest set that the machine supports.
    #[default]
    Best,
    /// One number at a time; every machine supports it.
    Scalar,
    /// AVX2 and FMA, four numbers at a time.
    Avx2,
    /// AVX-512, eight numbers at a time.
    Avx512,
}

impl InstructionSet {
    pub(crate) fn arch(self) -> Result<Arch, FemError> {
        let missing = |set: &str| FemError::Invalid {
            what: "instruction set",
            problem: format!("this machine does not support {set}; choose another set, e.g. the default"),
        };
        match self {
            Self::Best => Ok(Arch::new()),
            Self::Scalar => Ok(Arch::Scalar),
            #[cfg(target_arch = "x86_64")]
            Self::Avx2 => pulp::x86::V3::try_new().map(Arch::V3).ok_or_else(|| missing("AVX2 with FMA")),
            #[cfg(target_arch = "x86_64")]
            Self::Avx512 => pulp::x86::V4::try_new().map(Arch::V4).ok_or_else(|| missing("AVX-512")),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx2 => Err(missing("AVX2 with FMA")),
            #[cfg(not(target_arch = "x86_64"))]
            Self::Avx512 => Err(missing("AVX-512")),
        }
    }
}
