//! Robots of the files that planners have, loaded by the typed client.

use std::path::{Path, PathBuf};

use sha2::{Digest, Sha256};
use sublevel::client::{RobotFiles, RobotFilesError, StoredLink, StoredRobot};
use tonic::Code;

use super::{CUBE, SRDF, URDF};
use crate::harness::Running;

/// Most bytes of meshes that the client sends in a message.
const INLINE: usize = 2 << 20;

/// A hand with two fingers of one file.
const GRIPPER: &str = r#"<robot name="gripper">
  <link name="palm"><collision><geometry><sphere radius="0.02"/></geometry></collision></link>
  <link name="left"><collision><geometry><mesh filename="finger.off"/></geometry></collision></link>
  <link name="right"><collision><geometry><mesh filename="finger.off"/></geometry></collision></link>
  <joint name="open" type="prismatic"><parent link="palm"/><child link="left"/><origin xyz="0 0.1 0"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.05" effort="1" velocity="1"/></joint>
  <joint name="close" type="prismatic"><parent link="palm"/><child link="right"/><origin xyz="0 -0.2 0"/>
    <axis xyz="0 -1 0"/><limit lower="0" upper="0.05" effort="1" velocity="1"/></joint>
</robot>"#;

/// The crane with this mesh as its hand.
fn crane(mesh: &str) -> String {
    URDF.replace("hand.stl", mesh)
}

fn write(folder: &Path, name: &str, text: &str) -> PathBuf {
    let path = folder.join(name);
    std::fs::create_dir_all(path.parent().expect("a folder")).expect("made");
    std::fs::write(&path, text).expect("written");
    path
}

fn link<'a>(robot: &'a StoredRobot, name: &str) -> &'a StoredLink {
    robot.links.iter().find(|link| link.name == name).expect("a link")
}

/// The cube in a file of so many bytes: the rest are comments.
fn padded(bytes: usize) -> String {
    let comment = format!("#{}\n", " ".repeat(78));
    let mut text = CUBE.to_owned();
    while text.len() + comment.len() <= bytes {
        text += &comment;
    }
    let rest = "#".repeat(bytes.saturating_sub(text.len()));
    text + &rest
}

#[tokio::test(flavor = "multi_thread")]
async fn what_is_not_loaded_is_named_with_the_remedy() {
    let dir = tempfile::tempdir().expect("a directory");
    let folder = dir.path();
    let server = Running::start(&folder.join("data"));
    let client = server.client().await;
    let refused = async |files: RobotFiles, words: &[&str]| {
        let error = client.load_robot_files(&files).await.expect_err("refused");
        let said = error.to_string();
        assert!(words.iter().all(|word| said.contains(word)), "{words:?}: {said}");
        error
    };
    write(folder, "hand.off", CUBE);
    let good = write(folder, "crane.urdf", &crane("hand.off"));
    // Texts.
    let missing = folder.join("missing.urdf");
    let error = refused(RobotFiles::new(&missing), &["missing.urdf", "check the path"]).await;
    assert!(matches!(&error, RobotFilesError::Read { file, .. } if *file == missing), "{error:?}");
    let missing = folder.join("missing.srdf");
    let files = RobotFiles::new(&good).with_srdf(&missing);
    let error = refused(files, &["missing.srdf", "check the path"]).await;
    assert!(matches!(&error, RobotFilesError::Read { file, .. } if *file == missing), "{error:?}");
    let text = crane("hand.off").replace("<child link=\"hand\"/>", "<child link=\"hands\"/>");
    let broken = write(folder, "broken.urdf", &text);
    let error = refused(RobotFiles::new(&broken), &["broken.urdf", "hands", "line "]).await;
    assert!(matches!(&error, RobotFilesError::Urdf { file, .. } if *file == broken), "{error:?}");
    // Meshes that are not found.
    let by_name = "package://tools/meshes/hand.off";
    let packaged = write(folder, "packaged.urdf", &crane(by_name));
    write(folder, "elsewhere/tools/meshes/hand.off", CUBE);
    let foot = write(folder, "foot.urdf", &crane("meshes/foot.stl"));
    let outside = write(folder, "outside.urdf", &crane("package://tools/../hand.off"));
    let map = "with_package(\"tools\", DIR)";
    // A package that is named is searched for nowhere else.
    let wrong = RobotFiles::new(&packaged).with_package("tools", folder.join("nowhere"));
    let wrong = wrong.with_search(folder.join("elsewhere"));
    let cases: [(RobotFiles, &str, &[&str]); 4] = [
        (RobotFiles::new(foot), "meshes/foot.stl", &["there is no file", "correct the path"]),
        (RobotFiles::new(&packaged), by_name, &[map, "with_search(DIR)"]),
        (wrong, by_name, &["nowhere/meshes/hand.off", map]),
        (RobotFiles::new(outside), "package://tools/../hand.off", &["with_package(\"NAME\", DIR)"]),
    ];
    for (files, uri, words) in cases {
        let error = refused(files, &[words, &["link \"hand\"", uri]].concat()).await;
        let of_hand = |error: &RobotFilesError| match error {
            RobotFilesError::Mesh { link, error } => link == "hand" && error.uri == uri,
            _ => false,
        };
        assert!(of_hand(&error), "{error:?}");
        assert!(!error.to_string().contains("--"), "an option of the command line: {error}");
    }
    // Files that are found, and that no reader takes.
    for name in ["hand.step", "hand"] {
        let file = write(folder, name, "ISO-10303-21;");
        let urdf = write(folder, "other.urdf", &crane(name));
        let words = ["link \"hand\"", "off, obj, ply, stl, xyz or dae", "convert the file"];
        let error = refused(RobotFiles::new(urdf), &words).await;
        let expected = |error: &RobotFilesError| match error {
            RobotFilesError::Format { link, file: found } => link == "hand" && *found == file,
            _ => false,
        };
        assert!(expected(&error), "{error:?}");
    }
    // What the server refuses, by the field of the request.
    write(folder, "bad.off", "OFF\n3 0 0\n0 0 0\n1 0 0\n");
    let bad = write(folder, "bad.urdf", &crane("bad.off"));
    let srdf = write(folder, "broken.srdf", &SRDF.replace("</robot>", ""));
    let cases: [(RobotFiles, &str, &str); 3] = [
        (RobotFiles::new(bad), "meshes[0].mesh", "bad.off"),
        (RobotFiles::new(&good).with_srdf(srdf), "srdf", "line "),
        (RobotFiles::new(&good).with_max_gap(0.0), "max_gap_m", "positive"),
    ];
    for (files, field, word) in cases {
        let error = refused(files, &[word]).await;
        let RobotFilesError::Client(error) = error else { panic!("{error:?}") };
        assert_eq!((error.code(), error.field().as_deref()), (Some(Code::InvalidArgument), Some(field)), "{error}");
    }
    assert_eq!(client.list_robots().await.expect("listed").len(), 0);
    // All that was said about it, done.
    let srdf = write(folder, "crane.srdf", SRDF);
    let files = RobotFiles::new(&good).with_srdf(srdf);
    let robot = client.load_robot_files(&files).await.expect("loaded");
    assert!(robot.created && robot.groups[0].name == "all");
    let gap = link(&robot, "hand").gap_m.expect("a gap");
    let finer = client.load_robot_files(&files.with_max_gap(0.5 * gap)).await.expect("loaded");
    assert!(finer.id != robot.id && link(&finer, "hand").gap_m.expect("a gap") <= 0.5 * gap, "{finer:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn packages_are_found_by_name_and_by_search() {
    let dir = tempfile::tempdir().expect("a directory");
    let folder = dir.path();
    let server = Running::start(&folder.join("data"));
    let client = server.client().await;
    let load = async |files: &RobotFiles| client.load_robot_files(files).await.expect("loaded");
    let urdf = write(folder, "robot/crane.urdf", &crane("package://tools/meshes/hand.off"));
    write(folder, "elsewhere/tools/meshes/hand.off", CUBE);
    let [inside, package] = ["elsewhere", "elsewhere/tools"].map(|name| folder.join(name));
    let files = || RobotFiles::new(&urdf);
    let first = load(&files().with_package("tools", &package)).await;
    assert!(first.created);
    // Another mesh, which another package of the name has.
    write(folder, "other/meshes/hand.off", &CUBE.replace("0.1", "0.2"));
    let other = folder.join("other");
    let wider = load(&files().with_package("tools", &other).with_search(&inside)).await;
    assert!(wider.id != first.id && link(&wider, "hand").body != link(&first, "hand").body);
    for found in [
        files().with_package("tools", &other).with_package("tools", &package),
        files().with_package("others", &other).with_search(&inside),
        files().with_search(&package),
        files().with_search(folder.join("robot")).with_search(&inside),
    ] {
        let robot = load(&found).await;
        assert_eq!((robot.id, robot.created), (first.id, false), "{found:?}");
    }
    client.load_robot_files(&files()).await.expect_err("it is not beside the URDF");
    write(folder, "robot/tools/meshes/hand.off", CUBE);
    assert_eq!(load(&files()).await.id, first.id);
    // The same file by its path, its ending in capitals.
    write(folder, "robot/hand.OFF", CUBE);
    let by_path = load(&RobotFiles::new(write(folder, "robot/path.urdf", &crane("hand.OFF")))).await;
    assert!(by_path.id != first.id && link(&by_path, "hand").body == link(&first, "hand").body);
}

#[tokio::test(flavor = "multi_thread")]
async fn links_share_a_file_that_is_sent_once() {
    let dir = tempfile::tempdir().expect("a directory");
    let folder = dir.path();
    let server = Running::start(&folder.join("data"));
    let client = server.client().await;
    write(folder, "finger.off", CUBE);
    // A server refuses a file that is sent twice under one name; under two names it is sent twice.
    let mut bodies = Vec::new();
    for text in [GRIPPER.to_owned(), GRIPPER.replacen("finger.off", "./finger.off", 1)] {
        let files = RobotFiles::new(write(folder, "gripper.urdf", &text));
        let robot = client.load_robot_files(&files).await.expect("loaded");
        for name in ["left", "right"] {
            let link = link(&robot, name);
            assert!(link.gap_m.is_some_and(|gap| (0.0..=0.02).contains(&gap)), "{link:?}");
            bodies.push(link.body.expect("a body"));
        }
    }
    assert!(bodies.iter().all(|body| *body == bodies[0]), "one mesh makes one body: {bodies:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn meshes_that_fit_no_message_are_uploaded() {
    let dir = tempfile::tempdir().expect("a directory");
    let folder = dir.path();
    let server = Running::start(&folder.join("data"));
    let client = server.client().await;
    let is_uploaded = async |file: &str| {
        let id: String = Sha256::digest(file).iter().map(|byte| format!("{byte:02x}")).collect();
        match client.download(&id).await {
            Ok(blob) => {
                assert_eq!(blob.len(), file.len());
                true
            }
            Err(error) => {
                assert_eq!(error.code(), Some(Code::NotFound), "{error}");
                false
            }
        }
    };
    write(folder, "hand.off", CUBE);
    let files = RobotFiles::new(write(folder, "crane.urdf", &crane("hand.off")));
    let small = client.load_robot_files(&files).await.expect("loaded");
    assert!(small.created && !is_uploaded(CUBE).await);
    // The same mesh in larger files, the last beyond what any message holds.
    for (bytes, expected) in [(INLINE, false), (INLINE + 1, true), (5 << 20, true)] {
        let file = padded(bytes);
        assert_eq!(file.len(), bytes);
        write(folder, "hand.off", &file);
        let large = client.load_robot_files(&files).await.expect("loaded");
        assert_eq!(link(&large, "hand").body, link(&small, "hand").body, "{bytes} bytes");
        assert_eq!((large.id, large.created), (small.id, false), "{bytes} bytes");
        assert_eq!(is_uploaded(&file).await, expected, "{bytes} bytes");
    }
    // Files that fit one by one and not together: what comes first is sent in the message, and
    // what still fits.
    let [first, second] = [INLINE / 4 * 3, INLINE / 2].map(padded);
    write(folder, "first.off", &first);
    write(folder, "second.off", &second);
    write(folder, "little.off", CUBE);
    let geometry = "<collision><geometry><mesh filename=\"little.off\"/></geometry></collision>";
    let joint = "<joint name=\"turn\" type=\"continuous\"><parent link=\"palm\"/><child link=\"thumb\"/></joint>";
    let third = format!("<link name=\"thumb\">{geometry}</link>{joint}</robot>");
    let text = GRIPPER.replacen("finger.off", "first.off", 1).replacen("finger.off", "second.off", 1);
    let urdf = write(folder, "gripper.urdf", &text.replace("</robot>", &third));
    let robot = client.load_robot_files(&RobotFiles::new(urdf)).await.expect("loaded");
    for name in ["left", "right", "thumb"] {
        assert_eq!(link(&robot, name).body, link(&small, "hand").body, "{name}");
    }
    let uploaded = [is_uploaded(&first).await, is_uploaded(&second).await, is_uploaded(CUBE).await];
    assert_eq!(uploaded, [false, true, false]);
}
