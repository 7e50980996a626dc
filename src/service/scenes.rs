//! SceneService.

use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

use super::app_state::AppState;
use super::limits::{DEFAULT_OBJECTS_PAGE, MAX_OBJECTS_PAGE};
use super::proto::scene_service_server::SceneService;
use super::proto::{
    CommitForkRequest, CommitForkResponse, CreateSceneRequest, CreateSceneResponse, DeleteSceneRequest,
    DeleteSceneResponse, ForkSceneRequest, ForkSceneResponse, GetSceneRequest, GetSceneResponse, ListScenesRequest,
    ListScenesResponse, SceneSummary, StreamPosesRequest, StreamPosesResponse, UpdateSceneRequest, UpdateSceneResponse,
    WatchSceneRequest, WatchSceneResponse,
};
use super::{error, pose_stream, scene_watch, scene_wire, wire};
use crate::scene::RobotId;
use crate::store::{Catalogue, CatalogueError, SceneEntry};

#[derive(Debug)]
pub(super) struct Scenes(pub(super) AppState);

#[tonic::async_trait]
impl SceneService for Scenes {
    async fn create_scene(
        &self,
        request: Request<CreateSceneRequest>,
    ) -> Result<Response<CreateSceneResponse>, Status> {
        let name = request.into_inner().name;
        let scene = self.0.change("name", move |catalogue| catalogue.create_scene(&name)).await?;
        Ok(Response::new(CreateSceneResponse { scene: Some(scene_wire::summary(&SceneEntry::of(&scene, None))) }))
    }

    async fn get_scene(&self, request: Request<GetSceneRequest>) -> Result<Response<GetSceneResponse>, Status> {
        let GetSceneRequest { name, page_size, page_token } = request.into_inner();
        let live = self.0.live_scene(&name, "name").await?;
        let scene = live.snapshot();
        let size = match usize::try_from(page_size).unwrap_or(MAX_OBJECTS_PAGE) {
            0 => DEFAULT_OBJECTS_PAGE,
            size => size.min(MAX_OBJECTS_PAGE),
        };
        let after = scene_wire::page_token(&page_token, &scene)?;
        Ok(Response::new(scene_wire::page(&scene, live.origin(), after.as_deref(), size)))
    }

    async fn update_scene(
        &self,
        request: Request<UpdateSceneRequest>,
    ) -> Result<Response<UpdateSceneResponse>, Status> {
        let request = request.into_inner();
        wire::name(&request.scene, "scene")?;
        let mut update = scene_wire::update(&request)?;
        // What is not proven yet is proven before other changes have to wait for it.
        self.0.live_scene(&request.scene, "scene").await?;
        let ids = scene_wire::placed_robot_ids(&request)?;
        if !ids.is_empty() {
            let robot = |catalogue: &Catalogue, (index, id): (usize, &RobotId)| match catalogue.robot(id) {
                Ok(loaded) => Ok(loaded.robot.clone()),
                Err(CatalogueError::NoRobot(id)) => Err(CatalogueError::NoPlacedRobot { index, id }),
                Err(error) => Err(error),
            };
            let find = move |catalogue: &Catalogue| ids.iter().enumerate().map(|of| robot(catalogue, of)).collect();
            let robots = self.0.look("place_robots", find).await?;
            update.robots = scene_wire::placed_robots(&request, robots)?;
        }
        let scene = self.0.change("scene", move |catalogue| catalogue.update_scene(&request.scene, &update)).await?;
        Ok(Response::new(UpdateSceneResponse { revision: scene.revision() }))
    }

    async fn list_scenes(&self, request: Request<ListScenesRequest>) -> Result<Response<ListScenesResponse>, Status> {
        let (size, after) = wire::page(request.get_ref().page_size, &request.get_ref().page_token);
        let (scenes, more) = self.0.catalogue().await?.scenes(after, size);
        let scenes: Vec<SceneSummary> = scenes.iter().map(scene_wire::summary).collect();
        let next_page_token = match scenes.last() {
            Some(last) if more => last.name.clone(),
            _ => String::new(),
        };
        Ok(Response::new(ListScenesResponse { scenes, next_page_token }))
    }

    async fn delete_scene(
        &self,
        request: Request<DeleteSceneRequest>,
    ) -> Result<Response<DeleteSceneResponse>, Status> {
        let name = request.into_inner().name;
        wire::name(&name, "name")?;
        self.0.change("name", move |catalogue| catalogue.delete_scene(&name)).await?;
        Ok(Response::new(DeleteSceneResponse {}))
    }

    async fn fork_scene(&self, request: Request<ForkSceneRequest>) -> Result<Response<ForkSceneResponse>, Status> {
        let ForkSceneRequest { scene, fork, expected_revision } = request.into_inner();
        wire::name(&scene, "scene")?;
        wire::name(&fork, "fork")?;
        self.0.live_scene(&scene, "scene").await?;
        // In memory, and in constant time: no thread of its own.
        let made = self.0.catalogue().await?.fork_scene(&scene, &fork, expected_revision);
        let made = made.map_err(|error| {
            error::catalogue(&error, if matches!(error, CatalogueError::SceneExists(_)) { "fork" } else { "scene" })
        })?;
        Ok(Response::new(ForkSceneResponse {
            fork: Some(scene_wire::summary(&SceneEntry::of(&made.snapshot(), made.origin()))),
        }))
    }

    async fn commit_fork(&self, request: Request<CommitForkRequest>) -> Result<Response<CommitForkResponse>, Status> {
        let fork = request.into_inner().fork;
        wire::name(&fork, "fork")?;
        let scene = self.0.change("fork", move |catalogue| catalogue.commit_fork(&fork)).await?;
        Ok(Response::new(CommitForkResponse { revision: scene.revision() }))
    }

    type StreamPosesStream = ReceiverStream<Result<StreamPosesResponse, Status>>;

    async fn stream_poses(
        &self,
        request: Request<Streaming<StreamPosesRequest>>,
    ) -> Result<Response<Self::StreamPosesStream>, Status> {
        let (sender, stream) = mpsc::channel(1);
        tokio::spawn(pose_stream::run(self.0.clone(), request.into_inner(), sender));
        Ok(Response::new(ReceiverStream::new(stream)))
    }

    type WatchSceneStream = ReceiverStream<Result<WatchSceneResponse, Status>>;

    async fn watch_scene(
        &self,
        request: Request<WatchSceneRequest>,
    ) -> Result<Response<Self::WatchSceneStream>, Status> {
        let WatchSceneRequest { scene, from_revision, max_rate_hz } = request.into_inner();
        let pause = wire::pause(max_rate_hz)?;
        let live = self.0.live_scene(&scene, "scene").await?;
        let (sender, stream) = mpsc::channel(1);
        tokio::spawn(scene_watch::run((live, self.0.stopping()), from_revision, pause, sender));
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}
