//! Scenes.

use std::collections::BTreeMap;
use std::sync::Arc;

use super::connection::{Client, Connection};
use super::error::ClientError;
use super::robots::RobotPlacement;
use crate::body::BodyId;
use crate::measure::Pose;
use crate::scene::{Attach, Placement, SubjectPair, Update};
use crate::service::limits::MAX_MESSAGE_BYTES;
use crate::service::proto::scene_service_client::SceneServiceClient;
use crate::service::proto::{
    CommitForkRequest, CreateSceneRequest, DeleteSceneRequest, ForkSceneRequest, GetSceneRequest, ListScenesRequest,
    UpdateSceneRequest,
};
use crate::service::scene_wire;

/// A scene as it was read.
#[derive(Clone, Debug, Default)]
pub struct SceneState {
    /// Revision all of this is true of.
    pub revision: u64,
    /// Objects by name; each has its world pose, held ones, too.
    pub objects: BTreeMap<Arc<str>, Placement>,
    /// Pairs that may touch.
    pub allowed_pairs: Vec<SubjectPair>,
    /// Robots by name, with the values of all joints; their links are among the objects.
    pub robots: BTreeMap<Arc<str>, RobotPlacement>,
}

/// A scene or fork in a list.
#[derive(Clone, Debug, PartialEq)]
pub struct ListedScene {
    /// Its name.
    pub name: String,
    /// Grows with every change.
    pub revision: u64,
    /// Number of its objects.
    pub objects: u32,
    /// Of a fork: the scene that it was made of, and the revision of that at the time.
    pub parent: Option<(String, u64)>,
}

impl Client {
    pub(super) fn scenes(&self) -> SceneServiceClient<Connection> {
        SceneServiceClient::new(self.channel()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// Creates an empty scene; returns its revision.
    ///
    /// # Errors
    /// When the name is taken or not usable.
    pub async fn create_scene(&self, name: &str) -> Result<u64, ClientError> {
        let request = CreateSceneRequest { name: name.into() };
        let response = self.scenes().create_scene(request).await.map_err(self.refused())?;
        Ok(response.into_inner().scene.map_or(0, |scene| scene.revision))
    }

    /// All scenes and forks.
    ///
    /// # Errors
    /// When the server does not answer.
    pub async fn list_scenes(&self) -> Result<Vec<ListedScene>, ClientError> {
        let (mut client, mut scenes, mut page_token) = (self.scenes(), Vec::new(), String::new());
        loop {
            let request = ListScenesRequest { page_size: 1000, page_token };
            let page = client.list_scenes(request).await.map_err(self.refused())?.into_inner();
            scenes.extend(page.scenes.into_iter().map(|scene| ListedScene {
                name: scene.name,
                revision: scene.revision,
                objects: scene.object_count,
                parent: Some((scene.parent, scene.parent_revision)).filter(|(parent, _)| !parent.is_empty()),
            }));
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(scenes);
            }
        }
    }

    /// Reads a scene whole.
    ///
    /// # Errors
    /// When there is none, or it changes all the time while it is read.
    pub async fn scene(&self, name: &str) -> Result<SceneState, ClientError> {
        let (mut client, mut state, mut page_token) = (self.scenes(), SceneState::default(), String::new());
        loop {
            let request = GetSceneRequest { name: name.into(), page_size: 10_000, page_token };
            let page = client.get_scene(request).await.map_err(self.refused())?.into_inner();
            state.revision = page.scene.map_or(0, |scene| scene.revision);
            for (index, object) in page.objects.iter().enumerate() {
                let placement = scene_wire::placement(object, || format!("objects[{index}]"))?;
                state.objects.insert(placement.name.clone(), placement);
            }
            state.allowed_pairs.extend(scene_wire::subject_pairs(&page.allowed_pairs, "allowed_pairs")?);
            for (index, robot) in page.robots.iter().enumerate() {
                let placement = RobotPlacement::of(robot, &format!("robots[{index}]"))?;
                state.robots.insert(placement.name.clone(), placement);
            }
            page_token = page.next_page_token;
            if page_token.is_empty() {
                return Ok(state);
            }
        }
    }

    /// Adds objects, or replaces those whose names are known; returns the revision.
    ///
    /// # Errors
    /// When a name or body is not usable.
    pub async fn put_objects<'a>(
        &self,
        scene: &str,
        objects: impl IntoIterator<Item = (&'a str, &'a BodyId, Pose)>,
    ) -> Result<u64, ClientError> {
        let placement = |(name, body, pose): (&str, &BodyId, Pose)| Placement {
            name: name.into(),
            body: *body,
            pose: Some(pose),
            group: "".into(),
            padding_m: None,
            attachment: None,
        };
        let upserts = objects.into_iter().map(placement).collect();
        self.update_scene(scene, &Update { upserts, ..Update::default() }).await
    }

    /// Sets world poses of objects, on disk before it returns; returns the revision.
    ///
    /// # Errors
    /// When an object is not there.
    pub async fn set_poses<'a>(
        &self,
        scene: &str,
        poses: impl IntoIterator<Item = (&'a str, Pose)>,
    ) -> Result<u64, ClientError> {
        let set_poses = Some(scene_wire::pose_table_message(poses));
        self.send_update(UpdateSceneRequest { scene: scene.into(), set_poses, ..Default::default() }).await
    }

    /// Lets an object be held by another, where it is now; returns the revision.
    ///
    /// # Errors
    /// When an object is not there, or would be held by itself.
    pub async fn attach(&self, scene: &str, object: &str, to: &str) -> Result<u64, ClientError> {
        let attach = vec![Attach { name: object.into(), to: to.into(), pose: None, touch: Vec::new() }];
        self.update_scene(scene, &Update { attach, ..Update::default() }).await
    }

    /// Applies any update, whole or not at all; returns the revision.
    ///
    /// # Errors
    /// When the update cannot be applied.
    pub async fn update_scene(&self, scene: &str, update: &Update) -> Result<u64, ClientError> {
        self.send_update(scene_wire::update_message(scene, update)).await
    }

    async fn send_update(&self, request: UpdateSceneRequest) -> Result<u64, ClientError> {
        let response = self.scenes().update_scene(request).await.map_err(self.refused())?;
        Ok(response.into_inner().revision)
    }

    /// Removes a scene or fork.
    ///
    /// # Errors
    /// When there is none.
    pub async fn delete_scene(&self, name: &str) -> Result<(), ClientError> {
        self.scenes().delete_scene(DeleteSceneRequest { name: name.into() }).await.map_err(self.refused())?;
        Ok(())
    }

    /// Makes a fork of a scene; returns its revision.
    ///
    /// # Errors
    /// When there is no such scene, the name is taken, or there are too many.
    pub async fn fork_scene(&self, scene: &str, fork: &str) -> Result<u64, ClientError> {
        let request = ForkSceneRequest { scene: scene.into(), fork: fork.into(), expected_revision: None };
        let response = self.scenes().fork_scene(request).await.map_err(self.refused())?;
        Ok(response.into_inner().fork.map_or(0, |fork| fork.revision))
    }

    /// Makes the content of a fork the next revision of its parent; returns that.
    ///
    /// # Errors
    /// When the parent has changed since.
    pub async fn commit_fork(&self, fork: &str) -> Result<u64, ClientError> {
        let response = self.scenes().commit_fork(CommitForkRequest { fork: fork.into() }).await;
        Ok(response.map_err(self.refused())?.into_inner().revision)
    }
}
