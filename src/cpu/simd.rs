//! The choice of an instruction set. All of them give the same bytes (SPEC §12).

use fearless_simd::Level;

use crate::error::setting::SettingError;

/// The environment variable that forces an instruction set.
const VARIABLE: &str = "SHEETSPLAT_SIMD";

/// An instruction set for vectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Simd {
    /// Scalar code, except where the compiler vectorizes it, for processors that have none of the others.
    Scalar,
    /// x86; every 64-bit processor has it.
    Sse2,
    /// x86-64-v3, of which fused multiply-adds are not used.
    Avx2,
    /// x86 since Ice Lake.
    Avx512,
    /// ARM, 64 bits.
    Neon,
    /// WebAssembly, if it is compiled with the target feature `simd128`.
    Simd128,
}

impl Simd {
    /// All instruction sets, whatever the machine has.
    pub const ALL: [Self; 6] = [Self::Scalar, Self::Sse2, Self::Avx2, Self::Avx512, Self::Neon, Self::Simd128];

    /// Its name: `scalar`, `sse2`, `avx2`, `avx512`, `neon`, `simd128`.
    pub fn name(self) -> &'static str {
        match self {
            Self::Scalar => "scalar",
            Self::Sse2 => "sse2",
            Self::Avx2 => "avx2",
            Self::Avx512 => "avx512",
            Self::Neon => "neon",
            Self::Simd128 => "simd128",
        }
    }

    /// The instruction sets that this machine and this build have.
    pub fn available() -> Vec<Self> {
        Self::ALL.into_iter().filter(|simd| simd.level().is_some()).collect()
    }

    /// The level of the vector crate; `None` if the machine or the build lacks it.
    fn level(self) -> Option<Level> {
        match self {
            Self::Scalar => Some(Level::new()).filter(|level| level.is_fallback()),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Sse2 => Level::new().as_sse2().map(Level::Sse2),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Avx2 => Level::new().as_avx2().map(Level::Avx2),
            #[cfg(any(target_arch = "x86", target_arch = "x86_64"))]
            Self::Avx512 => Level::new().as_avx512().map(Level::Avx512),
            #[cfg(target_arch = "aarch64")]
            Self::Neon => Level::new().as_neon().map(Level::Neon),
            #[cfg(all(target_arch = "wasm32", target_feature = "simd128"))]
            Self::Simd128 => Level::new().as_wasm_simd128().map(Level::WasmSimd128),
            _ => None,
        }
    }

    /// The level of an instruction set, if machine and build have it.
    ///
    /// # Errors
    /// If the machine or the build lacks it.
    pub(super) fn checked(self) -> Result<Level, SettingError> {
        self.level().ok_or_else(|| refused(self.name()))
    }
}

/// Compiles code once for each instruction set, and runs it for that of a level. Every set lengthens the build by all kernels, so x86 has three: SSE2 serves
/// processors with SSE4.2, too.
macro_rules! dispatch {
    ($level:expr, $simd:ident => $code:expr) => {
        $crate::cpu::simd::dispatch!(@match $level, $simd => $code;
            Avx512: any(target_arch = "x86", target_arch = "x86_64"),
            Avx2: any(target_arch = "x86", target_arch = "x86_64"),
            Sse2: any(target_arch = "x86", target_arch = "x86_64"),
            Neon: target_arch = "aarch64",
            WasmSimd128: all(target_arch = "wasm32", target_feature = "simd128"),
            Fallback: not(any(
                all(any(target_arch = "x86", target_arch = "x86_64"), target_feature = "sse2"),
                target_arch = "aarch64",
                all(target_arch = "wasm32", target_feature = "simd128"),
            ))
        )
    };
    (@match $level:expr, $simd:ident => $code:expr; $($set:ident: $target:meta),*) => {
        match $level {
            $(#[cfg($target)]
            fearless_simd::Level::$set($simd) => fearless_simd::Simd::vectorize($simd, #[inline(always)] || $code),)*
            _ => unreachable!("levels are those of instruction sets that code is compiled for"),
        }
    };
}
pub(super) use dispatch;

/// The default: the instruction set that the environment forces, else the best one of the machine.
///
/// # Errors
/// If the machine or the build lacks the one that the environment forces.
pub(super) fn chosen() -> Result<(Simd, Level), SettingError> {
    let best = || Simd::available().into_iter().next_back().unwrap_or(Simd::Scalar);
    let simd = match std::env::var_os(VARIABLE) {
        None => best(),
        Some(name) => {
            let named = Simd::ALL.into_iter().find(|simd| name == simd.name());
            named.ok_or_else(|| refused(&name.to_string_lossy()))?
        }
    };
    Ok((simd, simd.checked()?))
}

fn refused(found: &str) -> SettingError {
    let names: Vec<String> = Simd::available().into_iter().map(|simd| format!("\"{}\"", simd.name())).collect();
    SettingError::new(VARIABLE, format!("\"{found}\""), format!("{} on this machine", names.join(", ")))
}
