//! What the targets in `fuzz/` call: certificates with digests that fit, whatever else was done to
//! them. Compiled for them only.

use sublevel_core::measure::{Options, Pose, WarmStart};

use super::certificate::Certificate;
use super::certificate_error::CertificateError;
use super::geometry::Piece;
use super::interval::Interval;
use super::placing::Placing;
use super::problem::{MotionProblem, PiecePair};
use super::solve::solve;
use super::verify_options::VerifyOptions;

/// Segments of a path that are looked at.
const SEGMENTS: usize = 16;

/// Samples of a segment, less one.
const SAMPLES: u64 = 8;

/// Halvings that make the intervals of samples: so short that almost nothing moves on them.
const HALVINGS: u8 = 45;

/// Longest lengths at which the solver is asked, metres: squares of much longer ones overflow.
const LONGEST_M: f64 = 1e9;

/// Bound of the error of the solver's upper bounds, relative to the lengths.
const ROUNDING: f64 = 1e-12;

/// The certificate as text with a digest that fits; none of a text that is no certificate.
pub fn sealed(text: &str) -> Option<String> {
    let mut certificate: Certificate = serde_json::from_str(text).ok()?;
    certificate.digest = certificate.computed_digest();
    Some(certificate.to_json())
}

/// A certificate, with its own digest and with one that fits: refused with a reason, or the same
/// after it was written. One that holds claims no more than the solver finds at samples of its
/// path.
pub fn certificate(text: &str) {
    if let Err(error) = Certificate::from_json(text) {
        assert!(!error.to_string().is_empty());
    }
    let Some(text) = sealed(text) else { return };
    let certificate = match Certificate::from_json(&text) {
        Ok(certificate) => certificate,
        Err(error) => return assert_ne!(error, CertificateError::Digest, "{text}"),
    };
    assert_eq!(certificate.to_json(), text);
    let verified = match certificate.verify() {
        Ok(verified) => verified,
        Err(error) => return assert!(!error.to_string().is_empty()),
    };
    let problem = certificate.claim.problem(&VerifyOptions::default(), usize::MAX).expect("what was verified");
    assert_eq!(verified.pairs, problem.pairs.len());
    // The bound of each pair is above its threshold, before the padding is taken from both.
    let padding_m = problem.pairs.iter().map(|pair| pair.padding_m.abs()).fold(0.0, f64::max);
    let slack = ROUNDING * (padding_m + certificate.margin_m().abs());
    assert!(verified.clearance_lower_m >= certificate.margin_m() - slack, "{verified:?}");
    if let Ok(against) = certificate.verify_against(&problem) {
        assert_eq!(against, verified);
    }
    let mut placing = Placing::default();
    for segment in (0..).take(certificate.path.segments().min(SEGMENTS)) {
        for sample in 0..=SAMPLES {
            let index = ((1 << HALVINGS) - 1) / SAMPLES * sample;
            placing.set(&problem, &certificate.path, &Interval { segment, halvings: HALVINGS, index });
            for pair in &problem.pairs {
                let Some(most) = most_m(&problem, &mut placing, pair) else { continue };
                assert!(verified.clearance_lower_m <= most, "segment {segment}, sample {sample}: {verified:?} {most}");
            }
        }
    }
}

/// What the signed distance of a pair less its padding is at most where it is placed, metres, by
/// the solver alone; none where a piece is too far away to have a pose, or too large.
fn most_m(problem: &MotionProblem, placing: &mut Placing, pair: &PiecePair) -> Option<f64> {
    let placed = placing.pair(problem, pair)?;
    let [a, b] = pair.pieces.map(|piece| problem.piece(piece).1);
    let (a, b) = ((&a, &placed[0].pose), (&b, &placed[1].pose));
    let sizes = size_m(a) + size_m(b) + pair.padding_m.abs();
    // Not `>`: a NaN is left out, too.
    if !(sizes <= LONGEST_M) {
        return None;
    }
    let found = solve(a, b, pair.threshold_m < 0.0, &Options::default(), &mut WarmStart::default());
    let off = placed[0].error_m() + placed[1].error_m() + placing.approach_m(pair, &placed);
    Some(found.upper - pair.padding_m + off + ROUNDING * sizes)
}

/// How far from the origin of the world a piece is and reaches, metres; of a half-space its plane.
fn size_m((piece, pose): (&Piece<'_>, &Pose)) -> f64 {
    match piece {
        Piece::HalfSpace(half_space, error_m) => half_space.offset().abs() + error_m,
        Piece::Body(_) | Piece::Capsule(_) => {
            let (center, radius) = piece.ball();
            pose.translation().norm() + center.norm() + radius
        }
    }
}
