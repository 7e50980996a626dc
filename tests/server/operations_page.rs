//! The operations page, command by command, in an empty directory: every one works as printed, and
//! says what the page says, numbers aside.

use std::io::Write;
use std::net::TcpListener;
use std::process::{Command, Stdio};

/// A command of the page, and what it prints there.
#[derive(Debug)]
struct Step {
    command: String,
    printed: Vec<String>,
}

fn steps(page: &str) -> Vec<Step> {
    let mut steps: Vec<Step> = Vec::new();
    for block in page.split("```console\n").skip(1) {
        let block = block.split("```").next().expect("the end of a block");
        let mut continued = false;
        for line in block.lines() {
            let command = line.strip_prefix("$ ");
            match steps.last_mut() {
                Some(step) if continued => step.command += &format!("\n{line}"),
                _ if command.is_some() => {
                    steps.push(Step { command: command.unwrap_or_default().to_owned(), printed: Vec::new() });
                }
                Some(step) => step.printed.push(line.to_owned()),
                None => panic!("output before a command: {line}"),
            }
            continued = line.ends_with('\\');
        }
    }
    steps
}

/// Every number and token alike.
fn shape(line: &str) -> String {
    let hidden = |word: &str| if word.chars().any(|c| c.is_ascii_digit()) { "#".into() } else { word.to_owned() };
    line.split_whitespace().map(hidden).collect::<Vec<_>>().join(" ")
}

fn free_port() -> u16 {
    TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a port").port()
}

#[test]
fn the_operations_page_works_as_printed() {
    for tool in ["bash", "openssl", "curl"] {
        let found = Command::new(tool).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status();
        assert!(found.is_ok(), "the page needs {tool}; install it");
    }
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/operations.md");
    let page = std::fs::read_to_string(path).expect("the page");
    let [port, admin] = [free_port(), free_port()].map(|port| port.to_string());
    let steps = steps(&page);
    assert!(steps.len() >= 12, "{} commands", steps.len());
    let mut script = "set -e\n".to_owned();
    for (index, step) in steps.iter().enumerate() {
        // Other ports, no address that others reach, and less patience than a person has.
        let mut command = step.command.replace("0.0.0.0", "127.0.0.1").replace("50051", &port).replace("50052", &admin);
        if command.starts_with("sublevel load") {
            command = command.replace(" --duration 60", "") + " --duration 0.5 --warmup 0.1";
        }
        // What the token command has shown, as a person copies it.
        command = command.replace("5b0c...", "$(cat shown)");
        script += &format!("echo '@@{index}'\n{command}\n");
        if command.starts_with("sublevel token") {
            let shown = format!("{command} 2> printed");
            script = script.replace(&command, &shown);
            script += "cat printed; sed 's/.*: //' printed > shown; sleep 2.5\n";
        }
        if command.ends_with('&') {
            script += "server=$!; trap 'kill $server' EXIT\n";
            script += &format!(
                "for i in $(seq 100); do curl -fs http://127.0.0.1:{admin}/readyz && break; sleep 0.1; done\n"
            );
        }
    }
    let dir = tempfile::tempdir().expect("a directory");
    let binary = std::path::Path::new(env!("CARGO_BIN_EXE_sublevel")).parent().expect("a folder");
    let path = format!("{}:{}", binary.display(), std::env::var("PATH").expect("a path"));
    let mut shell = Command::new("bash")
        .args(["-c", "exec bash /dev/stdin 2>&1"])
        .current_dir(dir.path())
        .env("PATH", path)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("bash");
    shell.stdin.take().expect("piped").write_all(script.as_bytes()).expect("read");
    let done = shell.wait_with_output().expect("an end");
    let said = String::from_utf8_lossy(&done.stdout);
    assert!(done.status.success(), "{said}\n---\n{script}");
    for (index, step) in steps.iter().enumerate() {
        let after = said.split(&format!("@@{index}\n")).nth(1).unwrap_or_default();
        let after: Vec<String> = after.split("@@").next().unwrap_or_default().lines().map(shape).collect();
        for line in &step.printed {
            assert!(after.contains(&shape(line)), "{}: \"{line}\" is not in {after:?}", step.command);
        }
    }
    for file in ["load.json", "load.svg", "sublevel.redb", "restored/catalogue.redb"] {
        assert!(dir.path().join(file).exists(), "{file} is missing");
    }
}
