//! HierarchyService: pairs of sets become jobs.

pub(crate) mod wire;

use tonic::{Request, Response, Status};

use super::app_state::AppState;
use super::error::Invalid;
use super::proto::hierarchy_service_server::HierarchyService;
use super::proto::{CreateHierarchySolveRequest, CreateHierarchySolveResponse};
use crate::body::{BodyId, Obstacle};
use crate::jobs::{Jobs, check_solve_of, obstacle};
use crate::store::{Catalogue, HierarchyRequest, NewJob};

#[derive(Debug)]
pub(super) struct HierarchyCalls {
    pub(super) app: AppState,
    pub(super) jobs: Jobs,
}

#[tonic::async_trait]
impl HierarchyService for HierarchyCalls {
    async fn create_hierarchy_solve(
        &self,
        request: Request<CreateHierarchySolveRequest>,
    ) -> Result<Response<CreateHierarchySolveResponse>, Status> {
        let (request_id, solve) = wire::request(request.get_ref())?;
        // A call that is repeated gets its job, whatever became of the bodies.
        if self.app.catalogue().await?.job_of_request(&request_id).is_none() {
            self.check(solve).await?;
        }
        let (jobs, new) = (self.jobs.clone(), NewJob::hierarchy(request_id, solve));
        let create = move |catalogue: &Catalogue| jobs.create(catalogue, new);
        let (job, created) = self.app.change("request_id", create).await?;
        Ok(Response::new(CreateHierarchySolveResponse { job_id: job.id.to_string(), created }))
    }
}

impl HierarchyCalls {
    /// What a solve needs: two sets, and a program that is not too large.
    async fn check(&self, solve: HierarchyRequest) -> Result<(), Status> {
        let [a, b] = solve.sets.map(|set| set.body);
        let sets = [self.set(a, wire::BODIES[0]).await?, self.set(b, wire::BODIES[1]).await?];
        let checked = self.app.work(move || check_solve_of(&solve, &sets)).await?;
        Ok(checked.map_err(wire::refused)?)
    }

    async fn set(&self, id: BodyId, field: &'static str) -> Result<Obstacle, Status> {
        let geometry = self.app.look(field, move |catalogue| catalogue.geometry(&id)).await?;
        Ok(obstacle(&geometry).map_err(|error| Invalid::new(field, error))?)
    }
}
