//! BodyService.

use tonic::{Request, Response, Status};

use super::app_state::AppState;
use super::proto::body_service_server::BodyService;
use super::proto::{
    CreateBodyRequest, CreateBodyResponse, DeleteBodyRequest, DeleteBodyResponse, GetBodyRequest, GetBodyResponse,
    ListBodiesRequest, ListBodiesResponse,
};
use super::{error, wire};
use crate::store::CatalogueError;

#[derive(Debug)]
pub(super) struct Bodies(pub(super) AppState);

#[tonic::async_trait]
impl BodyService for Bodies {
    async fn create_body(&self, request: Request<CreateBodyRequest>) -> Result<Response<CreateBodyResponse>, Status> {
        let file = request.into_inner().body_file_json;
        // Proving takes milliseconds to seconds, and nothing is lost when it is for nobody any
        // more.
        let body = self.0.prove(move || wire::body_file(&file)).await??;
        let (body, created) = self.0.change("body_file_json", move |catalogue| catalogue.create_body(body)).await?;
        Ok(Response::new(CreateBodyResponse { body: Some(wire::summary(&body)), created }))
    }

    async fn get_body(&self, request: Request<GetBodyRequest>) -> Result<Response<GetBodyResponse>, Status> {
        let id = wire::body_id(&request.get_ref().id, "id")?;
        let body =
            self.0.catalogue().await?.body(&id).ok_or_else(|| error::catalogue(&CatalogueError::NoBody(id), "id"))?;
        // Up to a whole message: not a thing for a thread that serves connections.
        let (body, body_file_json) = self
            .0
            .solve(move || {
                let file = body.to_json().into_bytes().into();
                (body, file)
            })
            .await?;
        Ok(Response::new(GetBodyResponse { body: Some(wire::summary(&body)), body_file_json }))
    }

    async fn list_bodies(&self, request: Request<ListBodiesRequest>) -> Result<Response<ListBodiesResponse>, Status> {
        let (size, after) = wire::page(request.get_ref().page_size, &request.get_ref().page_token);
        let after = after.map(|token| wire::body_id(token, "page_token")).transpose()?;
        let (bodies, more) = self.0.catalogue().await?.bodies(after.as_ref(), size);
        let next_page_token = match bodies.last() {
            Some(last) if more => last.id().to_string(),
            _ => String::new(),
        };
        let bodies = bodies.iter().map(|body| wire::summary(body)).collect();
        Ok(Response::new(ListBodiesResponse { bodies, next_page_token }))
    }

    async fn delete_body(&self, request: Request<DeleteBodyRequest>) -> Result<Response<DeleteBodyResponse>, Status> {
        let id = wire::body_id(&request.get_ref().id, "id")?;
        self.0.change("id", move |catalogue| catalogue.delete_body(&id)).await?;
        Ok(Response::new(DeleteBodyResponse {}))
    }
}
