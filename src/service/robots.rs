//! RobotService.

use tonic::{Request, Response, Status};

use super::app_state::AppState;
use super::error::{self, Invalid};
use super::proto::robot_service_server::RobotService;
use super::proto::{
    DeleteRobotRequest, DeleteRobotResponse, GetRobotRequest, GetRobotResponse, ListRobotsRequest, ListRobotsResponse,
    LoadRobotRequest, LoadRobotResponse,
};
use super::{robot_wire, wire};
use crate::scene::RobotError;
use crate::store::{CatalogueError, LoadError};

#[derive(Debug)]
pub(super) struct Robots(pub(super) AppState);

#[tonic::async_trait]
impl RobotService for Robots {
    async fn load_robot(&self, request: Request<LoadRobotRequest>) -> Result<Response<LoadRobotResponse>, Status> {
        let request = request.into_inner();
        let links: Vec<String> = request.link_bodies.iter().map(|body| body.link.clone()).collect();
        let source = robot_wire::source(request)?;
        let catalogue = self.0.catalogue().await?;
        // Proving the bodies of links takes milliseconds.
        let loaded = self.0.prove(move || catalogue.load_robot(source)).await?;
        let (loaded, created) = loaded.map_err(|error| load_error(&error, &links))?;
        let response = LoadRobotResponse { robot: Some(robot_wire::robot(&loaded)), created };
        error::fits(&response)?;
        Ok(Response::new(response))
    }

    async fn get_robot(&self, request: Request<GetRobotRequest>) -> Result<Response<GetRobotResponse>, Status> {
        let id = robot_wire::robot_id(&request.get_ref().id, "id")?;
        let loaded = self.0.look("id", move |catalogue| catalogue.robot(&id)).await?;
        let robot = Some(robot_wire::robot(&loaded));
        let (urdf, srdf) = (loaded.source.urdf.clone(), loaded.source.srdf.clone());
        let response = GetRobotResponse { robot, urdf, srdf };
        error::fits(&response)?;
        Ok(Response::new(response))
    }

    async fn list_robots(&self, request: Request<ListRobotsRequest>) -> Result<Response<ListRobotsResponse>, Status> {
        let (size, after) = wire::page(request.get_ref().page_size, &request.get_ref().page_token);
        let after = after.map(|token| robot_wire::robot_id(token, "page_token")).transpose()?;
        let (robots, next) =
            self.0.look("page_token", move |catalogue| Ok(catalogue.robots(after.as_ref(), size))).await?;
        let next_page_token = next.map(|id| id.to_string()).unwrap_or_default();
        let robots = robots.iter().map(|loaded| robot_wire::summary(&loaded.robot)).collect();
        Ok(Response::new(ListRobotsResponse { robots, next_page_token }))
    }

    async fn delete_robot(
        &self,
        request: Request<DeleteRobotRequest>,
    ) -> Result<Response<DeleteRobotResponse>, Status> {
        let id = robot_wire::robot_id(&request.get_ref().id, "id")?;
        self.0.change("id", move |catalogue| catalogue.delete_robot(&id)).await?;
        Ok(Response::new(DeleteRobotResponse {}))
    }
}

/// Why a robot is not loaded; `links` are those that the request gives bodies for.
fn load_error(error: &CatalogueError, links: &[String]) -> Status {
    let at = |link: &str, leaf: &str| match links.iter().position(|named| named == link) {
        Some(index) => format!("link_bodies[{index}]{leaf}"),
        None => "link_bodies".to_owned(),
    };
    let CatalogueError::Load(why) = error else { return error::catalogue(error, "link_bodies") };
    match why {
        LoadError::Urdf(_) => Invalid::new("urdf", why).into(),
        LoadError::Srdf(_) => Invalid::new("srdf", why).into(),
        LoadError::NoBody { link, id } => error::not_found("body", &id.to_string(), &at(link, ".body_id"), why),
        LoadError::Robot(RobotError::NoLink { link, .. }) => Invalid::new(at(link, ".link"), why).into(),
        LoadError::Robot(RobotError::HalfSpace { link }) => Invalid::new(at(link, ".body_id"), why).into(),
        LoadError::Robot(RobotError::Mesh { .. }) => Invalid::new("link_bodies", why).into(),
        LoadError::Robot(RobotError::Primitive { .. } | RobotError::Kinematics(_)) => Invalid::new("urdf", why).into(),
    }
}
