//! Data directories that cannot be used, or not any more: what is wrong is said with its remedy, and
//! nothing is lost.

use std::fs::{self, Permissions};
use std::os::unix::fs::{MetadataExt, PermissionsExt};
use std::os::unix::process::CommandExt;
use std::path::Path;
use std::process::{Command, Stdio};

use redb::{Database, TableDefinition};
use sublevel::client::Question;
use sublevel::measure::Pose;
use sublevel::scene::query::Measure;
use sublevel::service::proto::ListBodiesRequest;
use tonic::Code;

use crate::harness::{Running, command};

/// What a start on a directory says when it refuses.
fn refusal(mut serve: Command) -> String {
    let output = serve.stderr(Stdio::piped()).output().expect("it runs");
    let said = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{said}");
    assert!(output.stdout.is_empty() && !said.contains("panicked"), "{said}");
    said
}

fn along(x: f64) -> Pose {
    Pose::from_quaternion([x, 0.0, 0.0].into(), [0.0, 0.0, 0.0, 1.0]).expect("a pose")
}

#[tokio::test(flavor = "multi_thread")]
async fn a_directory_that_is_not_there_is_made() {
    let dir = tempfile::tempdir().expect("a directory");
    let data = dir.path().join("srv").join("sublevel");
    let server = Running::start(&data);
    assert!(server.client().await.list_scenes().await.expect("an answer").is_empty());
    assert!(data.join("catalogue.redb").exists());
}

#[tokio::test(flavor = "multi_thread")]
async fn a_directory_that_cannot_be_written_is_refused_by_name() {
    let dir = tempfile::tempdir().expect("a directory");
    fs::set_permissions(dir.path(), Permissions::from_mode(0o755)).expect("set");
    let data = dir.path().join("data");
    let server = Running::start(&data);
    server.client().await.create_scene("cell").await.expect("made");
    server.kill();
    let whole = fs::read(data.join("catalogue.redb")).expect("read");
    // Root may write anywhere: then somebody else is tried, with the program where he can see it.
    let program = dir.path().join("sublevel");
    fs::copy(env!("CARGO_BIN_EXE_sublevel"), &program).expect("copied");
    let serve = |data: &Path| {
        let mut serve = Command::new(&program);
        serve.args(["serve", "--listen", "127.0.0.1:0", "--data"]).arg(data);
        if fs::metadata(dir.path()).expect("there").uid() == 0 {
            serve.uid(65534);
        }
        serve.stdin(Stdio::null());
        serve
    };
    fs::set_permissions(data.join("catalogue.redb"), Permissions::from_mode(0o444)).expect("set");
    fs::set_permissions(&data, Permissions::from_mode(0o555)).expect("set");
    let empty = dir.path().join("empty");
    fs::create_dir(&empty).expect("made");
    fs::set_permissions(&empty, Permissions::from_mode(0o555)).expect("set");
    for data in [&data, &empty] {
        let said = refusal(serve(data));
        assert!(said.contains(data.to_str().expect("text")) && said.contains("permissions"), "{said}");
    }
    fs::set_permissions(&data, Permissions::from_mode(0o755)).expect("set");
    fs::set_permissions(data.join("catalogue.redb"), Permissions::from_mode(0o644)).expect("set");
    assert_eq!(fs::read(data.join("catalogue.redb")).expect("read"), whole, "nothing was written");
    assert_eq!(Running::start(&data).client().await.list_scenes().await.expect("an answer").len(), 1);
}

/// A file that may not grow, as on a full disk: changes are refused and say why, everything else is
/// answered, and a later start finds what was acknowledged.
#[tokio::test(flavor = "multi_thread")]
async fn a_full_disk_refuses_changes_and_goes_on_answering() {
    let dir = tempfile::tempdir().expect("a directory");
    let data = dir.path().join("data");
    let server = Running::start(&data);
    let client = server.client().await;
    let body = client.create_ball("ball", 0.1).await.expect("stored");
    client.create_scene("cell").await.expect("made");
    client.put_objects("cell", [("a", &body, along(0.0)), ("b", &body, along(1.0))]).await.expect("placed");
    server.kill();
    let bytes = fs::metadata(data.join("catalogue.redb")).expect("there").len();

    // In blocks of 512 bytes; who ignores the signal gets the error.
    let mut limited = Command::new("sh");
    limited.args(["-c", &format!("trap '' XFSZ; ulimit -f {}; exec \"$0\" \"$@\"", bytes.div_ceil(512) + 8)]);
    limited.arg(env!("CARGO_BIN_EXE_sublevel")).args(["serve", "--listen", "127.0.0.1:0", "--data"]).arg(&data);
    limited.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::null());
    let server = Running::spawn(limited);
    let client = server.client().await;
    let (mut stored, mut refused) = (0, None);
    for index in 0..20_000 {
        match client.create_ball("ball", 1.0 + 1e-3 * f64::from(index)).await {
            Ok(_) => stored += 1,
            Err(error) => {
                refused = Some(error);
                break;
            }
        }
    }
    let refused = refused.expect("the file may not grow");
    let why = (refused.code(), refused.reason());
    assert_eq!(why, (Some(Code::ResourceExhausted), Some("DISK_FULL".to_owned())), "{refused}");
    let answers = client.evaluate("cell", Question::pairs([("a", "b")]), &[Measure::Distance]).await;
    assert!((answers.expect("it answers").rows[0].value.expect("a value") - 0.8).abs() < 1e-8);
    assert!(client.health().await.expect("an answer"), "it can answer, so it is well");
    server.kill();

    let server = Running::start(&data);
    let (mut clients, mut count, mut page_token) = (server.connect().await, 0, String::new());
    loop {
        let page = clients.bodies.list_bodies(ListBodiesRequest { page_token, page_size: 1000 });
        let page = page.await.expect("a page").into_inner();
        count += page.bodies.len();
        page_token = page.next_page_token;
        if page_token.is_empty() {
            break;
        }
    }
    assert_eq!(count, stored + 1);
    server.client().await.create_ball("ball", 0.5).await.expect("there is space again");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_catalogue_of_a_newer_version_or_damaged_is_refused_and_left_as_it_is() {
    let dir = tempfile::tempdir().expect("a directory");
    let file = dir.path().join("catalogue.redb");
    let server = Running::start(dir.path());
    server.client().await.create_scene("cell").await.expect("made");
    server.kill();
    let whole = fs::read(&file).expect("read");
    {
        let meta: TableDefinition<&str, u64> = TableDefinition::new("meta");
        let database = Database::open(&file).expect("it opens");
        let transaction = database.begin_write().expect("begun");
        transaction.open_table(meta).expect("a table").insert("format", 99).expect("written");
        transaction.commit().expect("written");
    }
    let said = refusal(command(dir.path()));
    assert!(said.contains("format 99") && said.contains("use the version that wrote it"), "{said}");
    {
        let meta: TableDefinition<&str, u64> = TableDefinition::new("meta");
        let database = Database::open(&file).expect("it opens");
        let transaction = database.begin_write().expect("begun");
        {
            let mut table = transaction.open_table(meta).expect("a table");
            let before = table.insert("format", 5).expect("written");
            assert_eq!(before.map(|format| format.value()), Some(99), "it is as it was");
        }
        transaction.commit().expect("written");
    }
    assert_eq!(Running::start(dir.path()).client().await.list_scenes().await.expect("an answer").len(), 1);

    let mut zeroed = whole.clone();
    zeroed[..4096].fill(0);
    for (damaged, words) in [
        (whole[..whole.len() / 3].to_vec(), "damaged"),
        (zeroed, "damaged"),
        (b"this was never a database".to_vec(), "damaged"),
        (Vec::new(), "empty"),
    ] {
        fs::write(&file, &damaged).expect("written");
        let said = refusal(command(dir.path()));
        assert!(said.contains(words) && said.contains("backup"), "{} bytes: {said}", damaged.len());
        // But for the header, in which redb notes that it has been opened.
        let (now, from) = (fs::read(&file).expect("read"), damaged.len().min(4096));
        assert!(now.len() == damaged.len() && now[from..] == damaged[from..], "{} bytes were changed", damaged.len());
    }
    fs::write(&file, &whole).expect("written");
    assert_eq!(Running::start(dir.path()).client().await.list_scenes().await.expect("an answer").len(), 1);
}
