//! Tests of the readers, and the robots that they read.

mod free_joints;
mod joint_errors;
mod mesh_paths;
mod mutations;
mod panda;
mod pinocchio;
pub(crate) mod robots;
mod srdf;
mod srdf_errors;
mod urdf;
mod urdf_errors;
mod xml_errors;

use crate::DescriptionError;

/// A change of a text and the error that it makes.
struct Bad {
    from: &'static str,
    to: &'static str,
    line: u32,
    path: &'static str,
    says: &'static str,
}

const fn bad(from: &'static str, to: &'static str, line: u32, path: &'static str, says: &'static str) -> Bad {
    Bad { from, to, line, path, says }
}

/// Makes each change of a text that is otherwise read, and compares the errors.
fn check_all<T: std::fmt::Debug>(text: &str, read: impl Fn(&str) -> Result<T, DescriptionError>, cases: &[Bad]) {
    read(text).expect("the text without a change");
    for Bad { from, to, line, path, says } in cases {
        assert!(text.contains(from), "{from}");
        let error = read(&text.replacen(from, to, 1)).expect_err(to);
        assert_eq!((error.line, error.path.as_str()), (*line, *path), "{to}: {error}");
        assert!(error.to_string().contains(says), "{to}: {error}");
        assert!(error.column >= 1 && !error.remedy.is_empty(), "{to}: {error}");
    }
}
