//! Requests of every mode, with every option at other values than its default.

use sublevel_testkit::Seeded;

use crate::body::{Cone, Objective, Solver, SosMethod};
use crate::store::{
    FitBody, FitCompound, FitGroup, FitLadder, FitMode, FitPolynomial, FitPreparation, FitRequest, FitSosBody,
    FitWithinGap,
};

/// Usable requests, one of each mode, with numbers that use all their bits; every option is chosen
/// by some seed.
pub(crate) fn drawn(seed: u64) -> Vec<FitRequest> {
    let mut random = Seeded(seed);
    let sometimes = |random: &mut Seeded| random.index(3) > 0;
    let request = |random: &mut Seeded, mode: FitMode| {
        let scale = if matches!(mode, FitMode::Group(_)) { 1.0 } else { 1e-3 + random.positive() };
        let structured = if is_log_det_p(&mode) { Solver::Structured } else { Solver::Clarabel };
        let solver = [None, Some(Solver::Clarabel), Some(structured)][random.index(3)];
        FitRequest { name: format!("it {seed}"), input: format!("{}.off", random.index(9)), scale, mode, solver }
    };
    let polynomial = polynomial(&mut random);
    let (slabs, parts) = (random.index(16), 1 + random.index(64));
    let max_gap_m = 1e-3 + random.positive();
    let preparation = FitPreparation {
        trim: 0.5 * random.positive(),
        min_thickness_m: sometimes(&mut random).then(|| 1e-3 + random.positive()),
    };
    let objective = [Objective::LogDetP, Objective::TraceP][random.index(2)];
    let c = [1e-3 + random.positive(), f64::INFINITY][random.index(2)];
    let method = [SosMethod::Relaxed { c, objective }, SosMethod::InverseMoment][random.index(2)];
    let raw_frame = sometimes(&mut random);
    let degree = polynomial.degree;
    let bodies = 1 + random.index(3);
    let id = |random: &mut Seeded| format!("{:016x}", random.next()).repeat(4).parse().expect("an id");
    let group = FitGroup {
        body_ids: (0..bodies).map(|_| id(&mut random)).collect(),
        max_growth: sometimes(&mut random).then(|| 1e-3 + random.positive()),
        multiplier_degree: sometimes(&mut random).then(|| 2 * random.index(3)),
        degree,
    };
    let modes: [FitMode; 6] = [
        FitBody { polynomial, slabs, preparation }.into(),
        FitLadder { polynomial, slabs, preparation }.into(),
        FitWithinGap { max_gap_m, polynomial, preparation }.into(),
        FitCompound { parts, polynomial, slabs }.into(),
        FitSosBody { method, degree, raw_frame, preparation }.into(),
        group.into(),
    ];
    modes.map(|mode| request(&mut random, mode)).into()
}

/// Whether the structured solver has the program.
fn is_log_det_p(mode: &FitMode) -> bool {
    let polynomial = match mode {
        FitMode::Body(body) => &body.polynomial,
        FitMode::Ladder(ladder) => &ladder.polynomial,
        FitMode::WithinGap(within) => &within.polynomial,
        FitMode::Compound(compound) => &compound.polynomial,
        FitMode::SosBody(set) => {
            return matches!(set.method, SosMethod::Relaxed { objective: Objective::LogDetP, .. });
        }
        FitMode::Group(_) => return false,
    };
    polynomial.objective == Objective::LogDetP && polynomial.cone == Cone::Sos
}

/// One that the library takes: no objective and no refinement over the smaller cones.
fn polynomial(random: &mut Seeded) -> FitPolynomial {
    let cone = Cone::ALL[random.index(3)];
    let sos = cone == Cone::Sos;
    let objective = if sos { Objective::ALL[random.index(4)] } else { Objective::default() };
    let degrees = [None, Some(2), Some(4), Some(6), Some(8)];
    FitPolynomial {
        degree: degrees[random.index(objective.max_degree() / 2 + 1)],
        objective,
        cone,
        raw_frame: random.index(2) == 1,
        refine: sos && random.index(2) == 1,
    }
}

#[test]
fn requests_are_read_back_from_the_store() {
    for request in (0..200).flat_map(drawn) {
        let text = serde_json::to_string(&request).expect("JSON");
        assert_eq!(serde_json::from_str::<FitRequest>(&text).expect("a request"), request, "{text}");
        assert!(text.contains(&format!(r#""mode":{{"{}":"#, request.mode.name())), "{text}");
    }
}

#[test]
fn options_of_other_modes_cannot_be_stored() {
    let group = drawn(7).remove(5);
    let text = serde_json::to_string(&group).expect("JSON");
    for (from, to) in [(r#""max_growth""#, r#""slabs":2,"max_growth""#), (r#"{"group""#, r#"{"body":{},"group""#)] {
        let changed = text.replacen(from, to, 1);
        assert_ne!(changed, text);
        serde_json::from_str::<FitRequest>(&changed).expect_err(&changed);
    }
}

#[test]
fn triangles_matter_to_compounds_and_to_what_is_not_trimmed() {
    let uses = |mode: FitMode| FitRequest::new("it", mode).uses_triangles();
    let polynomial = FitPolynomial::default();
    for (trim, expected) in [(0.0, true), (0.1, false)] {
        let preparation = FitPreparation { trim, min_thickness_m: None };
        assert_eq!(uses(FitWithinGap { max_gap_m: 1.0, polynomial, preparation }.into()), expected);
        let method = SosMethod::InverseMoment;
        assert_eq!(uses(FitSosBody { method, degree: None, raw_frame: false, preparation }.into()), expected);
        assert!(!uses(FitBody { preparation, ..FitBody::default() }.into()));
    }
    assert!(uses(FitCompound { parts: 2, polynomial, slabs: 0 }.into()));
    assert!(!uses(FitLadder::default().into()) && !uses(FitGroup::default().into()));
}
