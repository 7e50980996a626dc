#![no_main]

mod described;

use std::collections::HashSet;
use std::sync::LazyLock;

use sublevel::robot::{Description, Kinematics, Semantics, read_srdf, read_urdf};
use sublevel::scene::{Robot, RobotId};

const URDF: &str = include_str!("../seeds/urdf/arm");

/// The robot that every text is about.
static ARM: LazyLock<Description> = LazyLock::new(|| read_urdf(URDF).expect("a robot"));

// An SRDF of a small robot: refused with a reason, or lists in order of links and joints that are
// there. Exactly the pairs that it disables and those of neighbours may touch.
libfuzzer_sys::fuzz_target!(|text: &str| match read_srdf(text, &ARM) {
    Ok(semantics) => {
        check_names(&semantics);
        check_groups(&semantics);
        check_states(&semantics);
        check_pairs(&semantics);
        check_robot(text, &semantics);
        assert!(semantics.warnings.len() <= 100);
        assert!(semantics.warnings.is_sorted_by_key(|warning| (warning.line, warning.column)));
    }
    Err(error) => described::check_error(text, &error),
});

fn is_ascending<T: PartialOrd>(list: &[T], end: &T) -> bool {
    list.is_sorted_by(|a, b| a < b) && list.last().is_none_or(|last| last < end)
}

fn check_names(semantics: &Semantics) {
    let (links, joints) = (ARM.links.len(), ARM.joints.len());
    let names: HashSet<_> = semantics.virtual_joints.iter().map(|joint| &joint.name).collect();
    assert_eq!(names.len(), semantics.virtual_joints.len());
    assert!(ARM.joints.iter().all(|joint| !names.contains(&joint.name)));
    assert!(semantics.virtual_joints.iter().all(|joint| joint.child_link < links));
    assert!(is_ascending(&semantics.passive_joints, &joints));
    let names: HashSet<_> = semantics.end_effectors.iter().map(|end| &end.name).collect();
    assert_eq!(names.len(), semantics.end_effectors.len());
    let groups = semantics.groups.len();
    for end in &semantics.end_effectors {
        assert!(end.group < groups && end.parent_link < links && end.parent_group.is_none_or(|group| group < groups));
    }
}

fn check_groups(semantics: &Semantics) {
    for (index, group) in semantics.groups.iter().enumerate() {
        assert_eq!(semantics.group(&group.name), Some(index));
        assert!(is_ascending(&group.joints, &ARM.joints.len()) && is_ascending(&group.links, &ARM.links.len()));
        assert!(is_ascending(&group.virtual_joints, &semantics.virtual_joints.len()));
        // A group has the links that its joints move.
        let moved = group.joints.iter().map(|&joint| ARM.joints[joint].child);
        let moved = moved.chain(group.virtual_joints.iter().map(|&joint| semantics.virtual_joints[joint].child_link));
        for link in moved {
            assert!(group.links.contains(&link), "{}", group.name);
        }
    }
}

fn check_states(semantics: &Semantics) {
    let mut names = HashSet::new();
    for state in &semantics.states {
        assert!(names.insert((state.group, &state.name)), "{}", state.name);
        let group = &semantics.groups[state.group];
        let (mut seen, mut seen_virtual) = (HashSet::new(), HashSet::new());
        for own in &state.values {
            let joint = &ARM.joints[own.joint];
            assert!(group.joints.contains(&own.joint) && seen.insert(own.joint), "{}", state.name);
            assert!(own.values.len() == joint.kind.width() && own.values.iter().all(|value| value.is_finite()));
            let is_within =
                joint.limits.is_none_or(|of| own.values.iter().all(|value| (of.lower..=of.upper).contains(value)));
            assert!(is_within || !semantics.warnings.is_empty(), "{}", state.name);
        }
        for own in &state.virtual_values {
            let joint = &semantics.virtual_joints[own.joint];
            assert!(group.virtual_joints.contains(&own.joint) && seen_virtual.insert(own.joint), "{}", state.name);
            assert!(own.values.len() == joint.kind.width() && own.values.iter().all(|value| value.is_finite()));
        }
    }
}

fn check_pairs(semantics: &Semantics) {
    let links = ARM.links.len();
    let disabled: Vec<_> = semantics.disabled_pairs.iter().map(|pair| (pair.first, pair.second)).collect();
    for pairs in [&disabled, &semantics.enabled_pairs] {
        assert!(
            is_ascending(pairs, &(links, 0)) && pairs.iter().all(|(first, second)| first < second && *second < links)
        );
    }
    assert!(is_ascending(&semantics.disabled_links, &links));
    assert!(disabled.iter().all(|pair| !semantics.enabled_pairs.contains(pair)));
    for a in 0..links {
        for b in (0..links).filter(|&b| b != a) {
            let pair = (a.min(b), a.max(b));
            let of_links = semantics.disabled_links.contains(&a) || semantics.disabled_links.contains(&b);
            let expected = disabled.contains(&pair) || of_links && !semantics.enabled_pairs.contains(&pair);
            assert_eq!(semantics.is_disabled(a, b), expected, "{a} {b}");
        }
    }
}

/// Links may touch that are disabled, and a link with the next one before it that has geometry.
fn check_robot(text: &str, semantics: &Semantics) {
    let bodies = described::bodies(&ARM);
    let id = RobotId::of(URDF, text, bodies.iter().map(|(link, body)| (&**link, body.id())));
    let robot = Robot::new(id, &ARM, semantics, &bodies).expect("a robot");
    let kinematics = robot.kinematics();
    let has_geometry = |link: &usize| !ARM.links[*link].collisions.is_empty();
    for a in (0..ARM.links.len()).filter(has_geometry) {
        for b in (0..ARM.links.len()).filter(has_geometry).filter(|&b| b != a) {
            let expected = semantics.is_disabled(a, b) || before(a) == Some(b) || before(b) == Some(a);
            let [at, other] = [a, b].map(|link| place(kinematics, link));
            assert_eq!(robot.may_touch(at, other), expected, "{a} {b}");
        }
    }
}

/// The next link with geometry on the way to the root.
fn before(link: usize) -> Option<usize> {
    let parent = ARM.joints.iter().find(|joint| joint.child == link)?.parent;
    if ARM.links[parent].collisions.is_empty() { before(parent) } else { Some(parent) }
}

fn place(kinematics: &Kinematics, link: usize) -> usize {
    kinematics.link(&ARM.links[link].name).expect("a link")
}
