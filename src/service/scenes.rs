//! SceneService.

use tonic::{Request, Response, Status};

use super::app_state::AppState;
use super::proto::scene_service_server::SceneService;
use super::proto::{
    CreateSceneRequest, CreateSceneResponse, DeleteSceneRequest, DeleteSceneResponse, GetSceneRequest,
    GetSceneResponse, ListScenesRequest, ListScenesResponse, UpdateSceneRequest, UpdateSceneResponse,
};
use super::{error, wire};
use crate::store::CatalogueError;

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
        Ok(Response::new(CreateSceneResponse { scene: Some(wire::scene_summary(&scene)) }))
    }

    async fn get_scene(&self, request: Request<GetSceneRequest>) -> Result<Response<GetSceneResponse>, Status> {
        let name = request.into_inner().name;
        wire::name(&name, "name")?;
        let scene = self
            .0
            .catalogue()
            .await?
            .scene(&name)
            .ok_or_else(|| error::catalogue(&CatalogueError::NoScene(name), "name"))?;
        Ok(Response::new(GetSceneResponse { scene: Some(wire::scene(&scene)) }))
    }

    async fn update_scene(
        &self,
        request: Request<UpdateSceneRequest>,
    ) -> Result<Response<UpdateSceneResponse>, Status> {
        let request = request.into_inner();
        wire::name(&request.name, "name")?;
        let update = wire::update(&request)?;
        let scene = self.0.change("name", move |catalogue| catalogue.update_scene(&request.name, &update)).await?;
        Ok(Response::new(UpdateSceneResponse { revision: scene.revision() }))
    }

    async fn list_scenes(&self, request: Request<ListScenesRequest>) -> Result<Response<ListScenesResponse>, Status> {
        let (size, after) = wire::page(request.get_ref().page_size, &request.get_ref().page_token);
        let (scenes, more) = self.0.catalogue().await?.scenes(after, size);
        let next_page_token = match scenes.last() {
            Some(last) if more => last.name().to_string(),
            _ => String::new(),
        };
        let scenes = scenes.iter().map(|scene| wire::scene_summary(scene)).collect();
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
}
