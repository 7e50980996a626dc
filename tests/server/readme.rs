//! What the README shows of the server, and the example, against a server.

use prost_reflect::{DescriptorPool, DynamicMessage, prost::Message};
use sublevel::body::Body;
use sublevel::service::proto::{
    CreateSceneRequest, EvaluateRequest, FILE_DESCRIPTOR_SET, SolveStatus, UpdateSceneRequest,
};

use crate::harness::{Running, ball};

#[allow(dead_code, unreachable_pub)]
#[path = "../../examples/planner.rs"]
mod planner;

/// Calls of a document: `Service/Method` and the JSON of the message.
fn calls(text: &str) -> Vec<(String, String)> {
    text.split("$ ask ")
        .skip(1)
        .filter_map(|call| {
            let (method, rest) = call.split_once(" '")?;
            let end = ["'\n", "' |\n"].iter().filter_map(|end| rest.find(end)).min()?;
            Some((method.to_owned(), rest[..end].to_owned()))
        })
        .collect()
}

/// The message of a call, as a client that knows the descriptors makes it.
fn message<T: Message + Default>(method: &str, json: &str) -> T {
    let pool = DescriptorPool::decode(FILE_DESCRIPTOR_SET).expect("descriptors");
    let (service, method) = method.split_once('/').expect("a method");
    let service = pool.get_service_by_name(&format!("sublevel.v1.{service}")).expect("a service");
    let input = service.methods().find(|known| known.name() == method).expect("a method").input();
    let mut json = serde_json::Deserializer::from_str(json);
    let message = DynamicMessage::deserialize(input, &mut json).unwrap_or_else(|error| panic!("{method}: {error}"));
    message.transcode_to().expect("the same message")
}

#[tokio::test(flavor = "multi_thread")]
async fn the_queries_of_the_documents_are_answered() {
    for document in ["README.md", "docs/server.md"] {
        let dir = tempfile::tempdir().expect("a directory");
        let server = Running::start(dir.path());
        let mut clients = server.connect().await;
        let chair = clients.put(&ball(0.2)).await;
        let human = clients.put(&Body::cuboid("human", nalgebra::Vector3::new(0.1, 0.2, 0.3)).expect("a box")).await;
        let text = std::fs::read_to_string(format!("{}/{document}", env!("CARGO_MANIFEST_DIR"))).expect("a document");
        let text = text.replace("'$CHAIR'", &chair).replace("'$HUMAN'", &human);
        let mut asked = Vec::new();
        for (method, json) in calls(&text) {
            match method.as_str() {
                "SceneService/CreateScene" => {
                    let request: CreateSceneRequest = message(&method, &json);
                    clients.scenes.create_scene(request).await.expect("created");
                }
                "SceneService/UpdateScene" => {
                    let request: UpdateSceneRequest = message(&method, &json);
                    clients.scenes.update_scene(request).await.expect("updated");
                }
                "QueryService/Evaluate" => {
                    let request: EvaluateRequest = message(&method, &json);
                    let response = clients.queries.evaluate(request).await.expect("answers").into_inner();
                    let [answer] = &response.answers[..] else { panic!("{response:?}") };
                    assert_eq!(answer.status(), SolveStatus::Converged);
                    assert!((answer.upper - 0.5).abs() < 1e-8 && answer.normal.is_some(), "{answer:?}");
                }
                other => panic!("{document}: {other} is not tried"),
            }
            asked.push(method);
        }
        let expected = ["SceneService/CreateScene", "SceneService/UpdateScene", "QueryService/Evaluate"];
        assert_eq!(asked, expected, "{document}");
    }
}

/// Lines without what they are indented by.
fn lines(text: &str) -> Vec<&str> {
    text.lines().map(str::trim).filter(|line| !line.is_empty()).collect()
}

#[test]
fn the_readme_shows_the_example_of_a_planner() {
    let read = |path: &str| std::fs::read_to_string(format!("{}/{path}", env!("CARGO_MANIFEST_DIR"))).expect("a text");
    let (page, example) = (read("README.md"), read("examples/planner.rs"));
    let shown = page.split("```rust,ignore\n").nth(1).and_then(|rest| rest.split("```").next()).expect("a block");
    let (shown, example) = (lines(shown), lines(&example));
    assert!(shown.len() > 20 && example.windows(shown.len()).any(|window| window == shown), "{shown:#?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_example_of_a_planner_runs() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    planner::run(&server.url()).await.expect("it runs");
}
