use super::families::{FAMILIES, Put};
use super::question::{Question, Verdict};
use super::runner::Cell;
use super::*;
use nalgebra::Vector3;
use sublevel::measure::{Distance, Pose, Status};
use sublevel_testkit::bodies::{b, chart_zoo, e};
use sublevel_testkit::catalogue::Case;
use sublevel_testkit::random::at;

/// Balls of radius 1 and 1/2 whose surfaces are a metre apart.
fn balls() -> Question {
    let (a, b) = (e(1.0, 1.0, 1.0), e(0.5, 0.5, 0.5));
    Question(Case::new(&a, Pose::identity(), &b, at(2.5, 0.0, 0.0), "balls"))
}

#[test]
fn the_arbiter_needs_no_good_proposals_of_the_one_that_is_judged() {
    let case = balls();
    let truth = case.truth(&[]).unwrap();
    assert!(truth.lower <= 1.0 + truth.floor && truth.upper >= 1.0 - truth.floor && truth.upper - truth.lower < 1e-11);
    // Directions all around refute what is far too short, without anyone's help.
    let alone = arbiter::judge(&case, &[]);
    assert!(alone.lower > 0.95 && alone.lower <= 1.0 && alone.upper.is_infinite());
}

#[test]
fn points_that_nothing_confirms_do_not_decide() {
    let case = balls();
    // Far sides of both balls: inside, consistent, and wrong.
    let points = [Vector3::new(-1.0, 0.0, 0.0), Vector3::new(3.0, 0.0, 0.0)];
    let proposal = arbiter::Proposal { points: Some(points), normal: Some(-Vector3::x()), active: [vec![0], vec![0]] };
    let truth = arbiter::judge(&case, &[proposal]);
    assert!(truth.upper > 3.9 && truth.lower <= 1.0 + truth.floor, "{truth:?}");
}

#[test]
fn the_first_seeds_meet_all_settings() {
    let case = |family: u8, seed| match FAMILIES.iter().find(|row| row.number() == family).unwrap().put {
        Put::Distance(case) => case(seed),
        Put::Distances(..) | Put::Own(_) => unreachable!(),
    };
    let accuracies: std::collections::BTreeSet<String> =
        (0..40).map(|seed| format!("{:e}", case(13, seed).accuracy)).collect();
    assert_eq!(accuracies.len(), 9, "{accuracies:?}");
    let shifts: std::collections::BTreeSet<String> =
        (0..60).map(|seed| case(6, seed).pose_b.translation().sum().to_string()).collect();
    assert!(shifts.len() >= 12, "{shifts:?}");
}

#[test]
fn answers_that_are_wrong_are_found_out() {
    let case = balls();
    let good = case.ours(Method::Cold).unwrap();
    assert_eq!(case.verdict(&good).unwrap(), Verdict::Pass);
    let off = |change: &dyn Fn(&mut Distance)| {
        let mut answer = good;
        change(&mut answer);
        case.verdict(&answer).unwrap()
    };
    // Brackets that miss the truth, with witnesses that go with them.
    for length in [0.9, 1.1] {
        let moved = |d: &mut Distance| {
            (d.lower, d.upper) = (length, length + 1e-10);
            d.witness_b = d.witness_a + Vector3::x() * (length + 5e-11);
        };
        assert!(matches!(off(&moved), Verdict::Off(error) if error > 0.1), "{length}");
    }
    let apart = |d: &mut Distance| d.witness_b += Vector3::x() * 1e-6;
    assert!(matches!(off(&apart), Verdict::WrongStatus(what) if what.contains("witnesses")));
    assert!(matches!(off(&|d| d.lower = 0.5), Verdict::WrongStatus(_)), "converged, and wide");
    assert!(matches!(off(&|d| (d.lower, d.status) = (0.5, Status::BracketWide)), Verdict::WrongStatus(_)), "wide");
    assert!(matches!(off(&|d| d.upper = f64::NAN), Verdict::WrongStatus(_)));
    let touching = |d: &mut Distance| (d.lower, d.upper, d.witness_b) = (0.0, 0.0, d.witness_a);
    assert!(matches!(off(&touching), Verdict::Off(_)));
}

#[test]
fn others_are_held_to_their_own_problem() {
    let case = balls();
    // Hulls inside of balls are farther apart, which is no failure of GJK.
    for method in [Method::Newton, Method::Slsqp, Method::Parry] {
        assert_eq!(case.put(method).unwrap(), Some(Verdict::Pass), "{method:?}");
    }
    let found = case.ask(Method::Parry).unwrap().unwrap();
    let own = found.own.unwrap();
    assert!(own.lower > 1.0001 && own.upper < 1.02 && own.upper - own.lower < 1e-9, "{own:?}");
    let truth = case.truth(&[]).unwrap();
    let reply = |value| method::Reply { value, proposal: arbiter::Proposal::default(), own: None };
    assert_eq!(reply(Some(1.0 + 1e-7)).verdict(&truth, &case), Verdict::Pass);
    for wrong in [1.01, 0.99, f64::NAN] {
        assert!(matches!(reply(Some(wrong)).verdict(&truth, &case), Verdict::Off(_)), "{wrong}");
    }
    assert_eq!(reply(None).verdict(&truth, &case), Verdict::NoAnswer);
    // A box has several constraints.
    let edged = Question(Case::new(&b(1.0, 1.0, 1.0), Pose::identity(), &case.b, at(2.5, 0.0, 0.0), "edged"));
    assert_eq!(edged.put(Method::Newton).unwrap(), None);
}

#[test]
fn cases_are_drawn_from_their_seeds_alone() {
    assert!(chart_zoo().len() >= 14);
    for family in &FAMILIES {
        let cases = |seed| match family.put {
            Put::Distance(case) => vec![case(seed)],
            Put::Distances(cases, _) => cases(seed),
            Put::Own(_) => Vec::new(),
        };
        for seed in 0..6 {
            let [one, two] = [(); 2].map(|()| cases(seed));
            assert_eq!(one.len(), two.len(), "{}", family.name());
            for (one, two) in one.iter().zip(&two) {
                assert_eq!((one.pose_a, one.pose_b, &one.what), (two.pose_a, two.pose_b, &two.what));
                assert_eq!((one.a.id(), one.b.id()), (two.a.id(), two.b.id()));
            }
        }
    }
}

fn table(failures: Vec<(u64, Verdict)>) -> Stability {
    let cells = vec![
        Cell { method: Method::Cold, cases: 40, left_out: 0, failures },
        Cell { method: Method::Parry, cases: 40, left_out: 9, failures: vec![(7, Verdict::Hang)] },
    ];
    let rows = vec![Row { number: 3, name: "faces, all but parallel", cells }];
    Stability { machine: Machine::this(), coal: None, solver: None, quick: true, methods: Method::ALL.to_vec(), rows }
}

#[test]
fn what_is_lost_is_named_and_peers_are_not_guarded() {
    let good = table(Vec::new());
    let bad = table(vec![(5, Verdict::Off(1e-3)), (6, Verdict::WrongStatus("wide".into()))]);
    let earlier = |table: &Stability| table.csv().parse::<Earlier>().unwrap();
    assert_eq!(good.lost_against(&earlier(&good)), Vec::new());
    assert_eq!(bad.lost_against(&earlier(&bad)), Vec::new());
    assert_eq!(good.lost_against(&earlier(&bad)), Vec::new());
    let lost = bad.lost_against(&earlier(&good));
    assert_eq!(lost.len(), 1);
    assert!(lost[0].family.contains("faces") && lost[0].what.ends_with("3/cold/5"), "{lost:?}");
    // As many failures, but another.
    let other = table(vec![(6, Verdict::NoAnswer), (8, Verdict::NoAnswer)]);
    let lost = other.lost_against(&earlier(&bad));
    assert!(lost.len() == 1 && lost[0].what.ends_with("3/cold/8"), "{lost:?}");
    let mut fewer = table(Vec::new());
    fewer.rows[0].cells.remove(0);
    assert_eq!(fewer.lost_against(&earlier(&good))[0].what, "is not put any more");
    assert_eq!("something".parse::<Earlier>().unwrap_err().to_string().split(' ').nth(1), Some("1"));
    assert!(format!("{}\n3,nothing", good.csv().lines().next().unwrap()).parse::<Earlier>().is_err());
    let text = bad.markdown();
    assert!(text.contains(
        "| 3 | faces, all but parallel | **2 of 40**: off by up to 1e-3, 1 wrong status | - | - | - | - | - | **1 of 40**: 1 hang; 9 not put any more |"
    ));
    assert!(text.contains("--replay 3/parry/7"));
}

#[test]
fn shares_are_read_as_they_are_printed() {
    let share = |text: &str| text.parse::<Share>();
    assert_eq!(share("13/cold/5"), Ok(Share { family: 13, method: Method::Cold, from: 5, to: 6 }));
    assert_eq!(share("1/parry/2-9"), Ok(Share { family: 1, method: Method::Parry, from: 2, to: 9 }));
    for bad in ["", "13", "17/cold/1", "13/someone/1", "13/cold/x", "13/cold/1/2", "13/cold/5-3", "13/cold/1000000"] {
        assert!(share(bad).is_err(), "{bad}");
    }
}
