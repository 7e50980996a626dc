//! BodyService.

use tonic::{Request, Response, Status};

use super::app_state::AppState;
use super::limits::{DEFAULT_MESH_DIVISIONS, MAX_MESH_DIVISIONS, MAX_MESSAGE_BYTES};
use super::proto::body_service_server::BodyService;
use super::proto::get_body_response::Content;
use super::proto::{
    CreateBodyRequest, CreateBodyResponse, DeleteBodyRequest, DeleteBodyResponse, GetBodyMeshRequest,
    GetBodyMeshResponse, GetBodyRequest, GetBodyResponse, ListBodiesRequest, ListBodiesResponse,
};
use super::{body_wire, error, wire};
use crate::scene::Geometry;

#[derive(Debug)]
pub(super) struct Bodies(pub(super) AppState);

#[tonic::async_trait]
impl BodyService for Bodies {
    async fn create_body(&self, request: Request<CreateBodyRequest>) -> Result<Response<CreateBodyResponse>, Status> {
        let (app, request) = (self.0.clone(), request.into_inner());
        let catalogue = self.0.catalogue().await?;
        // Proving takes milliseconds to seconds, and nothing is lost when it is for nobody any
        // more.
        let body =
            self.0.prove(move || body_wire::geometry(&request, app.blobs(), |id| catalogue.geometry(id))).await??;
        let (body, created) = self.0.change("source", move |catalogue| catalogue.create_body(body)).await?;
        Ok(Response::new(CreateBodyResponse { body: Some(body_wire::summary(&body)), created }))
    }

    async fn get_body(&self, request: Request<GetBodyRequest>) -> Result<Response<GetBodyResponse>, Status> {
        let body = self.find(&request.get_ref().id).await?;
        let app = self.0.clone();
        // Up to megabytes: not a thing for a thread that serves connections.
        let written = move || {
            let file = body.to_json().into_bytes();
            let content = if file.len() + 4096 > MAX_MESSAGE_BYTES {
                Content::BlobId(app.blobs().keep(file)?)
            } else {
                Content::File(file.into())
            };
            Ok::<_, Status>((body_wire::summary(&body), content))
        };
        let (body, content) = self.0.work(written).await??;
        Ok(Response::new(GetBodyResponse { body: Some(body), content: Some(content) }))
    }

    async fn list_bodies(&self, request: Request<ListBodiesRequest>) -> Result<Response<ListBodiesResponse>, Status> {
        let (size, after) = wire::page(request.get_ref().page_size, &request.get_ref().page_token);
        let after = after.map(|token| wire::body_id(token, "page_token")).transpose()?;
        let (bodies, next) =
            self.0.look("page_token", move |catalogue| Ok(catalogue.bodies(after.as_ref(), size))).await?;
        let next_page_token = next.map(|id| id.to_string()).unwrap_or_default();
        let bodies = bodies.iter().map(body_wire::summary).collect();
        Ok(Response::new(ListBodiesResponse { bodies, next_page_token }))
    }

    async fn delete_body(&self, request: Request<DeleteBodyRequest>) -> Result<Response<DeleteBodyResponse>, Status> {
        let id = wire::body_id(&request.get_ref().id, "id")?;
        self.0.change("id", move |catalogue| catalogue.delete_body(&id)).await?;
        Ok(Response::new(DeleteBodyResponse {}))
    }

    async fn get_body_mesh(
        &self,
        request: Request<GetBodyMeshRequest>,
    ) -> Result<Response<GetBodyMeshResponse>, Status> {
        let GetBodyMeshRequest { id, divisions } = request.into_inner();
        let divisions = divisions.unwrap_or(DEFAULT_MESH_DIVISIONS);
        if !(1..=MAX_MESH_DIVISIONS).contains(&divisions) {
            let why = format!("is {divisions}; send 1 to {MAX_MESH_DIVISIONS}, or leave it out");
            return Err(error::Invalid::new("divisions", why).into());
        }
        let body = self.find(&id).await?;
        let app = self.0.clone();
        let mesh = self.0.work(move || app.meshes().get(&body, divisions)).await?;
        let Some(mesh) = mesh else {
            return Err(error::no_surface(&id));
        };
        let response = GetBodyMeshResponse::clone(&mesh);
        error::fits(&response)?;
        Ok(Response::new(response))
    }
}

impl Bodies {
    async fn find(&self, id: &str) -> Result<Geometry, Status> {
        let id = wire::body_id(id, "id")?;
        self.0.look("id", move |catalogue| catalogue.geometry(&id)).await
    }
}
