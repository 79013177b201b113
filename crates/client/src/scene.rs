//! Telling everyone where the obstacles are.

use iceoryx2::port::update_connections::UpdateConnections;
use shared_types::clock::mono_now_ns;
use shared_types::ipc::{IpcNode, IpcOptions, Publisher, publisher, scene_service};
use shared_types::message::{MovingBall, SceneMessage};
use shared_types::valid::Scene;

use crate::ClientError;

/// Publishes the scene; the last one published is what there is.
#[derive(Debug)]
pub struct ScenePublisher {
    scenes: Publisher<SceneMessage>,
    _node: IpcNode,
}

impl ScenePublisher {
    /// Joins the service.
    ///
    /// # Errors
    /// [`ClientError::Ipc`].
    pub fn connect(options: &IpcOptions) -> Result<Self, ClientError> {
        let node = IpcNode::create(options, "pcc-scene")?;
        let scenes = publisher(&node, &scene_service(&node)?)?;
        Ok(Self {
            scenes,
            _node: node,
        })
    }

    /// Publishes all obstacles there are now, at most 1024; base frame, metres, m/s. Replaces the scene before.
    ///
    /// # Errors
    /// [`ClientError::InvalidRequest`] if a ball is not valid (the scene before then holds), or
    /// [`ClientError::Transport`].
    pub fn publish(&self, balls: &[MovingBall]) -> Result<(), ClientError> {
        let mut sample = self
            .scenes
            .loan()
            .map_err(|reason| ClientError::transport("prepare a scene", reason))?;
        Scene::write(mono_now_ns(), balls, sample.payload_mut())
            .map_err(ClientError::InvalidRequest)?;
        sample
            .send()
            .map(drop)
            .map_err(|reason| ClientError::transport("send a scene", reason))
    }

    /// Hands the last scene to programs that started after it was published; call it now and then while nothing changes.
    ///
    /// # Errors
    /// [`ClientError::Transport`].
    pub fn greet_latecomers(&self) -> Result<(), ClientError> {
        self.scenes
            .update_connections()
            .map_err(|reason| ClientError::transport("reach a new subscriber", reason))
    }
}
