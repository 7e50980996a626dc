//! The arithmetic of the processor at hand, chosen when the program runs.
//!
//! Work is compiled by `pulp` for any processor, for AVX2 with fused multiply-add and, where it is
//! lanes throughout ([`dispatch_lanes`]), for AVX-512. Everything it calls has to be inlined into
//! it to profit. Results differ between the versions only within the rounding bounds,
//! which count the roundings of the plain one.

use std::sync::{LazyLock, OnceLock};

pub use pulp::{Arch, Scalar, Simd, WithSimd};

/// A bound of the arithmetic in use, to compare them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SimdLimit {
    /// What every processor has.
    Baseline,
    /// AVX2 with fused multiply-add at most.
    Avx2,
}

/// See [`limit_simd`].
static LIMIT: OnceLock<SimdLimit> = OnceLock::new();

/// The widest arithmetic of this processor, or less where [`limit_simd`] or the environment
/// variable `SUBLEVEL_SIMD` (`avx2` or `baseline`; any other value is as none) asks for that.
static WIDEST: LazyLock<Arch> = LazyLock::new(|| {
    let limit = LIMIT.get().copied().or_else(|| match std::env::var("SUBLEVEL_SIMD").as_deref() {
        Ok("baseline") => Some(SimdLimit::Baseline),
        Ok("avx2") => Some(SimdLimit::Avx2),
        _ => None,
    });
    match limit {
        None => Arch::new(),
        Some(SimdLimit::Avx2) => at_most_avx2(),
        Some(SimdLimit::Baseline) => Arch::Scalar,
    }
});

#[cfg(target_arch = "x86_64")]
fn at_most_avx2() -> Arch {
    pulp::x86::V3::try_new().map_or(Arch::Scalar, Arch::V3)
}

#[cfg(not(target_arch = "x86_64"))]
fn at_most_avx2() -> Arch {
    Arch::new()
}

/// Bounds the arithmetic of this process; without effect once anything was computed.
pub fn limit_simd(limit: SimdLimit) {
    let _ = LIMIT.set(limit);
}

/// What [`dispatch`] uses: AVX2 in place of wider vectors, or nothing beyond the baseline. A type
/// without AVX-512, so that no work is compiled for arithmetic that it never runs on.
#[cfg(target_arch = "x86_64")]
static SUITED: LazyLock<Option<pulp::x86::V3>> =
    LazyLock::new(|| if matches!(*WIDEST, Arch::Scalar) { None } else { pulp::x86::V3::try_new() });

/// The widest arithmetic in use: "AVX-512", "AVX2" or "baseline".
pub fn widest() -> &'static str {
    match *WIDEST {
        #[cfg(target_arch = "x86_64")]
        Arch::V4(_) => "AVX-512",
        #[cfg(target_arch = "x86_64")]
        Arch::V3(_) => "AVX2",
        _ => "baseline",
    }
}

/// Does work that is lanes throughout with the widest arithmetic in use.
#[inline]
pub fn dispatch_lanes<T: WithSimd>(work: T) -> T::Output {
    WIDEST.dispatch(work)
}

/// Does work on single numbers, or on lanes now and then, with AVX2 where the processor has it:
/// among scalar instructions those of AVX-512 cost more than they save, for while one of them is
/// under way a port less takes all others. The searches of penetration depths, lanes between scalar
/// work, are 4 % faster so.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn dispatch<T: WithSimd>(work: T) -> T::Output {
    match *SUITED {
        Some(avx2) => Simd::vectorize(avx2, work),
        None => on_baseline(work),
    }
}

/// Does work without AVX2. It is compiled once, and not inlined into each caller: the largest
/// searches have three, and few processors run this.
#[cfg(target_arch = "x86_64")]
#[inline(never)]
fn on_baseline<T: WithSimd>(work: T) -> T::Output {
    Simd::vectorize(Scalar, work)
}

/// Does work with the widest arithmetic in use.
#[cfg(not(target_arch = "x86_64"))]
#[inline(always)]
pub fn dispatch<T: WithSimd>(work: T) -> T::Output {
    WIDEST.dispatch(work)
}

/// Every arithmetic of this processor.
#[cfg(test)]
pub(super) fn levels() -> Vec<Arch> {
    let mut levels = vec![Arch::Scalar];
    #[cfg(target_arch = "x86_64")]
    levels.extend(pulp::x86::V3::try_new().map(Arch::V3));
    levels.push(Arch::new());
    levels
}
