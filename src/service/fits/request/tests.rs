//! Requests to the wire and back, and what the wire can say that no request can.

use tonic::Status;

use super::*;
use crate::store::tests::requests::drawn;

fn sent(options: FitOptions) -> CreateFitRequest {
    CreateFitRequest { name: "it".into(), options: Some(options), ..CreateFitRequest::default() }
}

/// The request of a message that is accepted.
fn accepted(message: CreateFitRequest) -> FitRequest {
    request(message).unwrap_or_else(|invalid| panic!("{invalid:?}")).1
}

#[test]
fn requests_are_read_back_from_the_wire() {
    for wanted in (0..200).flat_map(drawn) {
        let message = message(&wanted);
        assert_eq!(accepted(message.clone()), wanted, "{message:?}");
    }
}

#[test]
fn an_unset_mode_is_a_body_of_the_default_degree() {
    let expected = FitRequest::new("it", FitBody::default());
    assert_eq!(accepted(sent(FitOptions::default())), expected);
    assert_eq!(accepted(CreateFitRequest { name: "it".into(), ..CreateFitRequest::default() }), expected);
    let trimmed = accepted(sent(FitOptions { trim: 0.25, ..FitOptions::default() }));
    let preparation = FitPreparation { trim: 0.25, min_thickness_m: None };
    assert_eq!(trimmed.mode, FitBody { preparation, ..FitBody::default() }.into());
}

#[test]
fn zero_is_zero() {
    let body = proto::FitBody { degree: Some(0), ..proto::FitBody::default() };
    refuses(Mode::Body(body), "body.degree", "2, 4, 6, 8");
    let ladder = proto::FitLadder { degree: Some(0), ..proto::FitLadder::default() };
    refuses(Mode::Ladder(ladder), "ladder.degree", "2, 4, 6, 8");
    refuses(Mode::WithinGap(proto::FitWithinGap::default()), "within_gap.max_gap_m", "positive finite");
    refuses(Mode::Compound(proto::FitCompound::default()), "compound.parts", "between 1 and 64");
    let relaxed = Method::Relaxed(FitRelaxed::default());
    let set = proto::FitSosBody { method: Some(relaxed), ..proto::FitSosBody::default() };
    refuses(Mode::SosBody(set), "sos_body.relaxed.c", "give c > 0");
    refuses(Mode::SosBody(proto::FitSosBody::default()), "sos_body", "`inverse_moment`");
    let multipliers = Mode::Group(proto::FitGroup { multiplier_degree: Some(0), degree: Some(4), ..group() });
    let FitMode::Group(read) = accepted(sent(FitOptions { mode: Some(multipliers), ..FitOptions::default() })).mode
    else {
        panic!("a group")
    };
    assert_eq!((read.multiplier_degree, read.degree), (Some(0), Some(4)));
}

/// What the modes leave expressible of options that exclude each other.
#[test]
fn options_of_points_go_with_points_only() {
    let compound = || Mode::Compound(proto::FitCompound { parts: 2, ..proto::FitCompound::default() });
    let with = |mode: Mode, change: fn(&mut FitOptions)| {
        let mut options = FitOptions { mode: Some(mode), ..FitOptions::default() };
        change(&mut options);
        options
    };
    let trim: fn(&mut FitOptions) = |options| options.trim = 0.01;
    let thick: fn(&mut FitOptions) = |options| options.min_thickness_m = Some(0.1);
    let scale: fn(&mut FitOptions) = |options| options.scale = Some(1e-3);
    for (options, at) in [
        (with(compound(), trim), "compound.parts"),
        (with(compound(), thick), "compound.parts"),
        (with(Mode::Group(group()), trim), "group"),
        (with(Mode::Group(group()), thick), "group"),
        (with(Mode::Group(group()), scale), "group"),
    ] {
        let message = refusal(options);
        assert!(message.starts_with(&format!("options.{at}: ")) && message.contains("leave out"), "{message}");
    }
    assert!(accepted(sent(with(compound(), scale))).uses_triangles());
}

#[test]
fn options_of_one_mode_that_exclude_each_other_are_refused_by_field() {
    let (dsos, trace_h) = (FitCone::Dsos.into(), FitObjective::TraceH.into());
    let over = |objective, refine| proto::FitBody { cone: dsos, objective, refine, ..proto::FitBody::default() };
    refuses(Mode::Body(over(0, true)), "body.cone", "take the cone sos");
    refuses(Mode::Body(over(trace_h, false)), "body.cone", "take the cone sos");
    let high = proto::FitCompound { parts: 2, degree: Some(8), objective: trace_h, ..proto::FitCompound::default() };
    refuses(Mode::Compound(high), "compound.objective", "lower the degree");
    let relaxed = Method::Relaxed(FitRelaxed { c: 1.0, objective: trace_h });
    let set = proto::FitSosBody { method: Some(relaxed), ..proto::FitSosBody::default() };
    refuses(Mode::SosBody(set), "sos_body.relaxed.objective", "take logdet-p or trace-p");
    let slabs = proto::FitLadder { slabs: 16, ..proto::FitLadder::default() };
    refuses(Mode::Ladder(slabs), "ladder.slabs", "raise the degree");
    let unknown = proto::FitWithinGap { max_gap_m: 1.0, objective: 99, ..proto::FitWithinGap::default() };
    refuses(Mode::WithinGap(unknown), "within_gap.objective", "none that this server knows");
    let unknown = proto::FitWithinGap { max_gap_m: 1.0, cone: 99, ..proto::FitWithinGap::default() };
    refuses(Mode::WithinGap(unknown), "within_gap.cone", "none that this server knows");
}

fn group() -> proto::FitGroup {
    proto::FitGroup { body_ids: vec!["5f".repeat(32)], ..proto::FitGroup::default() }
}

fn refusal(options: FitOptions) -> String {
    Status::from(request(sent(options)).expect_err("refused")).message().to_owned()
}

fn refuses(mode: Mode, at: &str, remedy: &str) {
    let message = refusal(FitOptions { mode: Some(mode), ..FitOptions::default() });
    assert!(message.starts_with(&format!("options.{at}: ")) && message.contains(remedy), "{message}");
}
