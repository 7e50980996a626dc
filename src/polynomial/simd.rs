//! The arithmetic of the processor at hand, chosen when the program runs.
//!
//! Work for [`dispatch`] and [`dispatch_lanes`] is compiled up to three times by `pulp`: for any processor, for AVX2 with fused
//! multiply-add, and for AVX-512. Everything it calls has to be inlined into it to profit. Results differ between the versions
//! only within the rounding bounds, which count the roundings of the plain one.

use std::sync::LazyLock;

pub use pulp::{Arch, Scalar, Simd, WithSimd};

/// Does work that is lanes throughout with the widest arithmetic of this processor.
#[inline]
pub fn dispatch_lanes<T: WithSimd>(work: T) -> T::Output {
    static WIDEST: LazyLock<Arch> = LazyLock::new(Arch::new);
    WIDEST.dispatch(work)
}

/// Does work on single numbers, or on lanes now and then, with AVX2 where the processor has it: among scalar instructions those
/// of AVX-512 cost more than they save, for while one of them is under way a port less takes all others. The searches of
/// penetration depths, lanes between scalar work, are 4 % faster so.
#[inline]
pub fn dispatch<T: WithSimd>(work: T) -> T::Output {
    static SUITED: LazyLock<Arch> = LazyLock::new(|| match Arch::new() {
        #[cfg(target_arch = "x86_64")]
        widest @ Arch::V4(_) => pulp::x86::V3::try_new().map_or(widest, Arch::V3),
        widest => widest,
    });
    SUITED.dispatch(work)
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
