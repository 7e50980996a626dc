//! Questions and answers in messages.

use std::collections::{BTreeMap, HashMap, HashSet};
use std::sync::Arc;

use nalgebra::{UnitQuaternion, Vector3};
use tonic::Status;

use crate::measure::{HalfSpace, Motion, Pose, RayError};
use crate::robot::counted;
use crate::scene::query::{
    Answer, AnswerStatus, Ask, AskError, Certainty, ClearanceRow, Measure, Motions, Operand, PairsError, RaysError,
    Selection, StateClearance, StateVerdict, StatesError, Verdict,
};
use crate::scene::{JointsError, Scene, Slot};

use super::error::{self, Invalid};
use super::packed::{self, Packed};
use super::proto::{self, Layout, Output};
use super::reason::Reason;
use super::state_reasons::StateReasons;
use super::wire;

/// What of an answer is sent, and how.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Outputs {
    pub(super) value: bool,
    pub(super) witnesses: bool,
    pub(super) normal: bool,
    pub(super) gradients: bool,
    pub(super) flags: bool,
    pub(super) parts: bool,
    pub(super) solver: bool,
    pub(super) objects: bool,
    pub(super) columns: bool,
}

pub(super) fn outputs(request: &proto::EvaluateRequest) -> Result<Outputs, Invalid> {
    let mut outputs = Outputs::default();
    for (index, &number) in request.outputs.iter().enumerate() {
        let flag = match Output::try_from(number) {
            Ok(Output::Value) => &mut outputs.value,
            Ok(Output::Witnesses) => &mut outputs.witnesses,
            Ok(Output::Normal) => &mut outputs.normal,
            Ok(Output::Gradients) => &mut outputs.gradients,
            Ok(Output::Flags) => &mut outputs.flags,
            Ok(Output::Parts) => &mut outputs.parts,
            Ok(Output::Solver) => &mut outputs.solver,
            Ok(Output::Objects) => &mut outputs.objects,
            Err(_) | Ok(Output::Unspecified) => {
                return Err(Invalid::new(format!("outputs[{index}]"), "is no output this server knows"));
            }
        };
        *flag = true;
    }
    outputs.columns = match Layout::try_from(request.layout) {
        Ok(Layout::Unspecified | Layout::Rows) => false,
        Ok(Layout::Columns) => true,
        Err(_) => return Err(Invalid::new("layout", "is no layout this server knows")),
    };
    Ok(outputs)
}

/// What of the rows of a clearance is sent by choice; the rest always is.
pub(super) fn clearance_outputs(request: &proto::ClearanceRequest) -> Outputs {
    Outputs { witnesses: request.with_witnesses, gradients: !request.without_gradients, ..Outputs::default() }
}

/// What is asked of every pair.
pub(super) fn ask(request: &proto::EvaluateRequest, outputs: &Outputs, scene: &Scene) -> Result<Ask, Status> {
    let mut measures = Vec::new();
    for (index, &number) in request.measures.iter().enumerate() {
        measures.push(measure(number, &format!("measures[{index}]"))?);
    }
    let refused = |field: String| move |error: AskError| Invalid::new(field, error);
    let mut ask = Ask::new(measures).map_err(refused("measures".into()))?;
    if let Some(accuracy) = request.accuracy {
        ask = ask.with_accuracy(accuracy).map_err(refused("accuracy".into()))?;
    }
    for (index, single) in request.accuracies.iter().enumerate() {
        let of = measure(single.measure, &format!("accuracies[{index}].measure"))?;
        let field = format!("accuracies[{index}].accuracy");
        ask = ask.with_measure_accuracy(of, single.accuracy).map_err(refused(field))?;
    }
    match request.threshold_m {
        Some(threshold) => ask = ask.with_threshold(threshold).map_err(refused("threshold_m".into()))?,
        None if ask.measures().contains(&Measure::NearerThan) => {
            return Err(Invalid::new("threshold_m", "is missing; MEASURE_NEARER_THAN compares with it").into());
        }
        None => {}
    }
    ask.gradients = outputs.gradients;
    ask.include_allowed = request.include_allowed;
    ask.cold = request.cold;
    match &request.motions {
        Some(table) => ask.motions = Some(Arc::new(motions(table, scene)?)),
        None if ask.measures().contains(&Measure::TimeOfImpact) => {
            return Err(Invalid::new("motions", "is missing; MEASURE_TIME_OF_IMPACT follows it").into());
        }
        None => {}
    }
    Ok(ask)
}

fn measure(number: i32, field: &str) -> Result<Measure, Invalid> {
    Ok(match proto::Measure::try_from(number) {
        Ok(proto::Measure::Distance) => Measure::Distance,
        Ok(proto::Measure::LevelDistanceAOnB) => Measure::LevelAOnB,
        Ok(proto::Measure::LevelDistanceBOnA) => Measure::LevelBOnA,
        Ok(proto::Measure::GrowthDistance) => Measure::Growth,
        Ok(proto::Measure::SignedDistance) => Measure::Signed,
        Ok(proto::Measure::PenetrationDepth) => Measure::Penetration,
        Ok(proto::Measure::Overlap) => Measure::Overlap,
        Ok(proto::Measure::NearerThan) => Measure::NearerThan,
        Ok(proto::Measure::TimeOfImpact) => Measure::TimeOfImpact,
        Err(_) | Ok(proto::Measure::Unspecified) => {
            return Err(Invalid::new(field, "is no measure this server knows; see Measure"));
        }
    })
}

pub(crate) fn measure_message(measure: Measure) -> proto::Measure {
    match measure {
        Measure::Distance => proto::Measure::Distance,
        Measure::LevelAOnB => proto::Measure::LevelDistanceAOnB,
        Measure::LevelBOnA => proto::Measure::LevelDistanceBOnA,
        Measure::Growth => proto::Measure::GrowthDistance,
        Measure::Signed => proto::Measure::SignedDistance,
        Measure::Penetration => proto::Measure::PenetrationDepth,
        Measure::Overlap => proto::Measure::Overlap,
        Measure::NearerThan => proto::Measure::NearerThan,
        Measure::TimeOfImpact => proto::Measure::TimeOfImpact,
    }
}

/// A finite length that is not negative.
pub(super) fn length(value: f64, field: &str) -> Result<f64, Invalid> {
    if value >= 0.0 && value.is_finite() {
        return Ok(value);
    }
    Err(Invalid::new(field, format!("is {value} m; send a finite number that is not negative")))
}

/// Slot of an object that is named.
pub(super) fn slot(scene: &Scene, name: &str, field: impl Fn() -> String) -> Result<Slot, Status> {
    if let Some(slot) = scene.slot(name) {
        return Ok(slot);
    }
    wire::name(name, &field())?;
    let why = format!("no object \"{name}\" in scene \"{}\"; add it first", scene.name());
    Err(error::not_found(Reason::ObjectNotFound, name, &field(), why))
}

pub(super) fn slots(scene: &Scene, names: &[String], field: &str) -> Result<Vec<Slot>, Status> {
    let one = |(index, name): (usize, &String)| slot(scene, name, || format!("{field}[{index}]"));
    names.iter().enumerate().map(one).collect()
}

/// Objects and groups that are selected; nothing named means all.
pub(super) fn selection(selection: Option<&proto::Selection>, scene: &Scene, field: &str) -> Result<Selection, Status> {
    let Some(proto::Selection { objects, groups }) = selection else { return Ok(Selection::all()) };
    if objects.is_empty() && groups.is_empty() {
        return Ok(Selection::all());
    }
    let slots = slots(scene, objects, &format!("{field}.objects"))?;
    let groups: HashSet<Arc<str>> = groups.iter().map(|group| group.as_str().into()).collect();
    Ok(Selection::of(scene, slots, &groups))
}

/// The poses of the call by slot.
pub(super) fn overrides(table: &proto::PoseTable, scene: &Scene) -> Result<Vec<(Slot, Pose)>, Status> {
    let poses = super::scene_wire::pose_table(table, "pose_overrides")?;
    let leaf = if table.rows.is_empty() { "names" } else { "rows" };
    let (mut seen, mut placed) = (HashSet::new(), Vec::with_capacity(poses.len()));
    for (index, (name, pose)) in poses.into_iter().enumerate() {
        let at = || format!("pose_overrides.{leaf}[{index}]");
        let slot = slot(scene, &name, at)?;
        if !seen.insert(slot) {
            return Err(Invalid::new(at(), format!("object \"{name}\" is named twice; name it once")).into());
        }
        placed.push((slot, pose));
    }
    Ok(placed)
}

/// Motions from one pose to another, along the shorter arc about the origin of the body frame.
fn motions(table: &proto::Motions, scene: &Scene) -> Result<Motions, Status> {
    let duration_s = table.duration_s.unwrap_or(1.0);
    if !(duration_s > 0.0 && duration_s.is_finite()) {
        let why = format!("is {duration_s} s; send a finite time above 0");
        return Err(Invalid::new("motions.duration_s", why).into());
    }
    let slots = slots(scene, &table.names, "motions.names")?;
    let starts = packed::poses(&table.start_poses, "motions.start_poses")?;
    let ends = packed::poses(&table.end_poses, "motions.end_poses")?;
    for (field, count) in [("motions.start_poses", starts.len()), ("motions.end_poses", ends.len())] {
        if count != slots.len() {
            let (poses, names) = (counted(count, "pose", "poses"), counted(slots.len(), "name", "names"));
            let why = format!("holds {poses} for {names}; send one for each");
            return Err(Invalid::new(field, why).into());
        }
    }
    let mut moving = HashMap::with_capacity(slots.len());
    for (index, ((slot, start), end)) in slots.into_iter().zip(starts).zip(ends).enumerate() {
        let motion = motion(&start, &end, duration_s).map_err(|why| Invalid::new("motions.end_poses", why))?;
        if moving.insert(slot, motion).is_some() {
            let why = "names an object twice; name it once";
            return Err(Invalid::new(format!("motions.names[{index}]"), why).into());
        }
    }
    Ok(Motions { moving, duration_s })
}

fn motion(start: &Pose, end: &Pose, duration_s: f64) -> Result<Motion, String> {
    let velocity = (end.translation() - start.translation()) / duration_s;
    let turn: UnitQuaternion<f64> = end.rotation() * start.rotation().inverse();
    let angular = turn.scaled_axis() / duration_s;
    Motion::new(*start, velocity, angular, *start.translation()).map_err(|error| error.to_string())
}

/// Named pairs as operands and positions.
pub(super) fn pair_list(list: &proto::PairList, scene: &Scene) -> Result<(Vec<Operand>, Vec<[u32; 2]>), Status> {
    let proto::PairList { objects, points_m, half_spaces, pairs, rows } = list;
    if !rows.is_empty() {
        if !objects.is_empty() || !pairs.is_empty() || !points_m.is_empty() || !half_spaces.is_empty() {
            return Err(Invalid::new("pairs.rows", "are sent along with packed pairs; send either").into());
        }
        return pair_rows(rows, scene);
    }
    let mut operands: Vec<Operand> = slots(scene, objects, "pairs.objects")?.into_iter().map(Operand::Object).collect();
    for (index, point) in packed::rows::<3>(points_m, "pairs.points_m")?.into_iter().enumerate() {
        let point = Vector3::from(point);
        if !(point.amax() <= 1e15) {
            let why = "is not finite, or beyond 1e15 m";
            return Err(Invalid::new(format!("pairs.points_m[{index}]"), why).into());
        }
        operands.push(Operand::Point(point));
    }
    for (index, [x, y, z, offset]) in packed::rows::<4>(half_spaces, "pairs.half_spaces")?.into_iter().enumerate() {
        let half_space = HalfSpace::new(Vector3::new(x, y, z), offset);
        let half_space = half_space.map_err(|error| Invalid::new(format!("pairs.half_spaces[{index}]"), error))?;
        operands.push(Operand::HalfSpace(half_space));
    }
    Ok((operands, packed::indices::<2>(pairs, "pairs.pairs")?))
}

fn pair_rows(rows: &[proto::ObjectPair], scene: &Scene) -> Result<(Vec<Operand>, Vec<[u32; 2]>), Status> {
    let (mut operands, mut known, mut pairs) = (Vec::new(), HashMap::new(), Vec::new());
    for (index, row) in rows.iter().enumerate() {
        let mut place = |name: &str, leaf: &str| {
            let slot = slot(scene, name, || format!("pairs.rows[{index}].{leaf}"))?;
            Ok::<u32, Status>(*known.entry(slot).or_insert_with(|| {
                operands.push(Operand::Object(slot));
                wire::count(operands.len() - 1)
            }))
        };
        pairs.push([place(&row.a, "a")?, place(&row.b, "b")?]);
    }
    Ok((operands, pairs))
}

/// Names of the objects that answers name, each once.
#[derive(Debug, Default)]
pub(super) struct NameTable {
    places: BTreeMap<Slot, u32>,
    pub(super) names: Vec<String>,
}

impl NameTable {
    pub(super) fn place(&mut self, slot: Slot, scene: &Scene) -> u32 {
        *self.places.entry(slot).or_insert_with(|| {
            self.names.push(scene.object(slot).map(|object| object.name.to_string()).unwrap_or_default());
            wire::count(self.names.len() - 1)
        })
    }
}

/// Position of no object.
pub(super) const NOTHING: u32 = u32::MAX;

pub(super) fn verdict(verdict: StateVerdict) -> proto::Verdict {
    match verdict {
        StateVerdict::Free => proto::Verdict::Free,
        StateVerdict::Contact => proto::Verdict::Contact,
        StateVerdict::Undecided => proto::Verdict::Undecided,
        StateVerdict::Invalid => proto::Verdict::Invalid,
        StateVerdict::NotChecked => proto::Verdict::NotChecked,
    }
}

pub(super) fn certainty(certainty: Certainty) -> proto::Certainty {
    match certainty {
        Certainty::None => proto::Certainty::Unspecified,
        Certainty::Certain => proto::Certainty::Certain,
        Certainty::Possible => proto::Certainty::Possible,
    }
}

pub(super) fn status(status: AnswerStatus) -> proto::SolveStatus {
    match status {
        AnswerStatus::Converged => proto::SolveStatus::Converged,
        AnswerStatus::BracketWide => proto::SolveStatus::BracketWide,
        AnswerStatus::Deadline => proto::SolveStatus::Deadline,
        AnswerStatus::NotDefined => proto::SolveStatus::NotDefined,
        AnswerStatus::Allowed => proto::SolveStatus::Allowed,
    }
}

/// One byte: 1 not unique, 2 saturated, 4 one-sided.
pub(super) fn flags(answer: &Answer) -> u8 {
    u8::from(answer.not_unique) | u8::from(answer.saturated) << 1 | u8::from(answer.one_sided) << 2
}

/// An answer as a row.
pub(super) fn row(answer: &Answer, outputs: &Outputs) -> proto::Answer {
    let [part_a, part_b] = if outputs.parts { answer.parts.map(u32::from) } else { [0; 2] };
    let [rung_a, rung_b] = if outputs.parts { answer.rungs.map(u32::from) } else { [0; 2] };
    let witnesses = answer.witnesses.as_ref().filter(|_| outputs.witnesses);
    let gradients = answer.gradients.as_ref().filter(|_| outputs.gradients);
    let known = |value: f64, asked: bool| Some(value).filter(|value| asked && !value.is_nan());
    proto::Answer {
        status: status(answer.status).into(),
        lower: answer.lower,
        upper: answer.upper,
        value: known(answer.value, outputs.value),
        decision: answer.verdict.map_or(proto::Decision::Unspecified, decision).into(),
        witness_a_m: witnesses.map(|[a, _]| wire::vector(a)),
        witness_b_m: witnesses.map(|[_, b]| wire::vector(b)),
        normal: answer.normal.as_ref().filter(|_| outputs.normal).map(wire::vector),
        gradient_a: gradients.map(|[a, _]| wire::gradient(a)),
        gradient_b: gradients.map(|[_, b]| wire::gradient(b)),
        not_unique: outputs.flags && answer.not_unique,
        saturated: outputs.flags && answer.saturated,
        one_sided: outputs.flags && answer.one_sided,
        part_a,
        part_b,
        rung_a,
        rung_b,
        iterations: if outputs.solver { answer.iterations } else { 0 },
        multiplier: known(answer.multiplier, outputs.solver),
        objects_upper: known(answer.objects_upper, outputs.objects),
    }
}

fn decision(verdict: Verdict) -> proto::Decision {
    match verdict {
        Verdict::Yes => proto::Decision::Yes,
        Verdict::No => proto::Decision::No,
        Verdict::Undecided => proto::Decision::Undecided,
    }
}

/// Clearances of states, in order.
pub(super) fn clearance(
    states: impl Iterator<Item = StateClearance>,
    scene: &Scene,
    outputs: &Outputs,
) -> proto::ClearanceResponse {
    let mut names = NameTable::default();
    let [mut offsets, mut pairs, mut status_bytes, mut lower, mut upper] = [(); 5].map(|()| Packed::default());
    let [mut padding, mut gradient_a, mut gradient_b, mut normal] = [(); 4].map(|()| Packed::default());
    let [mut flag_bytes, mut checked, mut joint_gradients] = [(); 3].map(|()| Packed::default());
    let [mut witness_a, mut witness_b] = [(); 2].map(|()| Packed::default());
    let (mut rows, mut reasons) = (0, StateReasons::default());
    offsets.index(0);
    for state in states {
        reasons.push(state.invalid.as_deref());
        checked.byte(state.checked.into());
        for ClearanceRow { pair, answer, padding_m } in &state.rows {
            pair.iter().for_each(|&slot| pairs.index(names.place(slot, scene)));
            status_bytes.byte(u8::try_from(i32::from(status(answer.status))).unwrap_or(0));
            lower.number(answer.lower);
            upper.number(answer.upper);
            padding.number(*padding_m);
            if outputs.gradients {
                gradient_a.twist(answer.gradients.as_ref().map(|[a, _]| a));
                gradient_b.twist(answer.gradients.as_ref().map(|[_, b]| b));
            }
            if outputs.witnesses {
                witness_a.vector(answer.witnesses.as_ref().map(|[a, _]| a));
                witness_b.vector(answer.witnesses.as_ref().map(|[_, b]| b));
            }
            normal.vector(answer.normal.as_ref());
            flag_bytes.byte(flags(answer));
        }
        state.joint_gradients.iter().for_each(|&number| joint_gradients.number(number));
        rows += state.rows.len();
        offsets.index(wire::count(rows));
    }
    proto::ClearanceResponse {
        scene_revision: scene.revision(),
        offsets: offsets.into_bytes(),
        objects: names.names,
        pairs: pairs.into_bytes(),
        status: status_bytes.into_bytes(),
        lower_m: lower.into_bytes(),
        upper_m: upper.into_bytes(),
        padding_m: padding.into_bytes(),
        gradient_a: gradient_a.into_bytes(),
        gradient_b: gradient_b.into_bytes(),
        normal: normal.into_bytes(),
        flags: flag_bytes.into_bytes(),
        checked: checked.into_bytes(),
        joint_gradients: joint_gradients.into_bytes(),
        witness_a_m: witness_a.into_bytes(),
        witness_b_m: witness_b.into_bytes(),
        reasons: reasons.into_texts(),
    }
}

/// Which field makes states unusable.
pub(super) fn states_error(error: &StatesError) -> Invalid {
    match error {
        StatesError::NoObject => Invalid::new("objects", error),
        StatesError::Twice(index) => Invalid::new(format!("objects[{index}]"), error),
        StatesError::Numbers { .. } | StatesError::NoState | StatesError::Several(_) => Invalid::new("poses", error),
        StatesError::JointNumbers { .. } | StatesError::NoJointState | StatesError::OneState { .. } => {
            Invalid::new("joint_values", error)
        }
        StatesError::Joints(of_joints) => Invalid::new(joints_field(of_joints), error),
        StatesError::NoRobot(_) | StatesError::NoGeometry(_) | StatesError::NoJoints(_) => Invalid::new("robot", error),
    }
}

/// Which field makes values of joints unusable.
pub(super) fn joints_field(error: &JointsError) -> String {
    match error {
        JointsError::NoJoint { index, .. } | JointsError::Twice { index, .. } => format!("joints[{index}]"),
        JointsError::Width { .. } | JointsError::Configuration(_) => "joint_values".to_owned(),
    }
}

/// Which field makes pairs unusable.
pub(super) fn pairs_error(error: PairsError) -> Invalid {
    let (PairsError::NoOperand { pair, .. }
    | PairsError::Itself { pair, .. }
    | PairsError::NeedsConvex { pair, .. }
    | PairsError::NoObject { pair }) = error;
    Invalid::new(format!("pairs[{pair}]"), error)
}

/// Which field makes rays unusable.
pub(super) fn rays_error(error: RaysError) -> Invalid {
    match error {
        RaysError::Ray { index: 0, error: RayError::Length(_) } => Invalid::new("max_length_m", error),
        RaysError::Ray { index, .. } => Invalid::new(format!("rays[{index}]"), error),
        RaysError::Radius(_) => Invalid::new("radius_m", error),
    }
}
