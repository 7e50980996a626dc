//! RobotService.

use tonic::{Request, Response, Status};

use super::app_state::AppState;
#[cfg(feature = "fit")]
use super::derive_wire;
use super::error::{self, Invalid};
#[cfg(feature = "fit")]
use super::link_fits::LinkFits;
use super::proto::robot_service_server::RobotService;
use super::proto::{
    DeleteRobotRequest, DeleteRobotResponse, DeriveAllowedPairsRequest, DeriveAllowedPairsResponse, GetRobotRequest,
    GetRobotResponse, ListRobotsRequest, ListRobotsResponse, LoadRobotRequest, LoadRobotResponse,
};
use super::reason::Reason;
use super::{robot_wire, wire};
#[cfg(feature = "fit")]
use crate::jobs::Jobs;
use crate::scene::RobotError;
#[cfg(feature = "fit")]
use crate::store::{Catalogue, NewJob};
use crate::store::{CatalogueError, LoadError};

#[derive(Debug)]
pub(super) struct Robots {
    pub(super) app: AppState,
    #[cfg(feature = "fit")]
    pub(super) jobs: Jobs,
    #[cfg(feature = "fit")]
    pub(super) fits: LinkFits,
}

#[tonic::async_trait]
impl RobotService for Robots {
    async fn load_robot(&self, request: Request<LoadRobotRequest>) -> Result<Response<LoadRobotResponse>, Status> {
        let mut request = request.into_inner();
        let links: Vec<String> = request.link_bodies.iter().map(|body| body.link.clone()).collect();
        self.fit_links(&mut request).await?;
        let source = robot_wire::source(request)?;
        let catalogue = self.app.catalogue().await?;
        // Proving the bodies of links takes milliseconds.
        let loaded = self.app.prove(move || catalogue.load_robot(source)).await?;
        let (loaded, created) = loaded.map_err(|error| load_error(&error, &links))?;
        let response = LoadRobotResponse { robot: Some(robot_wire::robot(&loaded)), created };
        error::fits(&response)?;
        Ok(Response::new(response))
    }

    async fn get_robot(&self, request: Request<GetRobotRequest>) -> Result<Response<GetRobotResponse>, Status> {
        let id = robot_wire::robot_id(&request.get_ref().id, "id")?;
        let loaded = self.app.look("id", move |catalogue| catalogue.robot(&id)).await?;
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
            self.app.look("page_token", move |catalogue| Ok(catalogue.robots(after.as_ref(), size))).await?;
        let next_page_token = next.map(|id| id.to_string()).unwrap_or_default();
        let robots = robots.iter().map(|loaded| robot_wire::summary(&loaded.robot)).collect();
        Ok(Response::new(ListRobotsResponse { robots, next_page_token }))
    }

    async fn delete_robot(
        &self,
        request: Request<DeleteRobotRequest>,
    ) -> Result<Response<DeleteRobotResponse>, Status> {
        let id = robot_wire::robot_id(&request.get_ref().id, "id")?;
        self.app.change("id", move |catalogue| catalogue.delete_robot(&id)).await?;
        Ok(Response::new(DeleteRobotResponse {}))
    }

    async fn derive_allowed_pairs(
        &self,
        request: Request<DeriveAllowedPairsRequest>,
    ) -> Result<Response<DeriveAllowedPairsResponse>, Status> {
        self.create_derivation(request.get_ref()).await.map(Response::new)
    }
}

#[cfg(feature = "fit")]
impl Robots {
    async fn fit_links(&self, request: &mut LoadRobotRequest) -> Result<(), Status> {
        self.fits.resolve(&self.app, request).await
    }

    async fn create_derivation(
        &self,
        request: &DeriveAllowedPairsRequest,
    ) -> Result<DeriveAllowedPairsResponse, Status> {
        let (request_id, asked) = derive_wire::request(request)?;
        // A call that is repeated gets its job, whatever became of the robot.
        if self.app.catalogue().await?.job_of_request(&request_id).is_none() {
            let robot = asked.robot;
            let loaded = self.app.look("robot_id", move |catalogue| catalogue.robot(&robot)).await?;
            derive_wire::check_size(&loaded)?;
        }
        let (jobs, new) = (self.jobs.clone(), NewJob::derive(request_id, asked));
        let create = move |catalogue: &Catalogue| jobs.create(catalogue, new);
        let (job, created) = self.app.change("robot_id", create).await?;
        Ok(DeriveAllowedPairsResponse { job_id: job.id.to_string(), created })
    }
}

#[cfg(not(feature = "fit"))]
impl Robots {
    async fn fit_links(&self, request: &mut LoadRobotRequest) -> Result<(), Status> {
        if request.meshes.is_empty() {
            return Ok(());
        }
        let why = "cannot be fitted: this server was built without the feature fit; send bodies in link_bodies";
        Err(Invalid::new("meshes", why).into())
    }

    async fn create_derivation(&self, _: &DeriveAllowedPairsRequest) -> Result<DeriveAllowedPairsResponse, Status> {
        Err(Status::unimplemented("this server was built without jobs; build it with the feature fit"))
    }
}

/// Why a robot is not loaded; `links` are those that the request gives bodies for.
pub(super) fn load_error(error: &CatalogueError, links: &[String]) -> Status {
    let at = |link: &str, leaf: &str| match links.iter().position(|named| named == link) {
        Some(index) => format!("link_bodies[{index}]{leaf}"),
        None => "link_bodies".to_owned(),
    };
    let CatalogueError::Load(why) = error else { return error::catalogue(error, "link_bodies") };
    match why {
        LoadError::Urdf(_) => Invalid::new("urdf", why).into(),
        LoadError::Srdf(_) => Invalid::new("srdf", why).into(),
        LoadError::NoBody { link, id } => {
            error::not_found(Reason::BodyNotFound, &id.to_string(), &at(link, ".body_id"), why)
        }
        LoadError::Robot(RobotError::NoLink { link, .. }) => Invalid::new(at(link, ".link"), why).into(),
        LoadError::Robot(RobotError::HalfSpace { link }) => Invalid::new(at(link, ".body_id"), why).into(),
        LoadError::Robot(RobotError::Mesh { .. }) => Invalid::new("link_bodies", why).into(),
        LoadError::Robot(RobotError::Primitive { .. } | RobotError::Kinematics(_)) => Invalid::new("urdf", why).into(),
    }
}
