//! The listener for operators: probes and metrics over HTTP/1, apart from the calls.

use std::sync::Arc;

use axum::Router;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use axum::routing::get;
use tokio::net::TcpListener;
use tokio::sync::watch;

use super::admin_listener::AdminListener;
use super::metrics::Metrics;
use crate::robot::counted;
use crate::store::{Catalogue, Counts};

/// What the probes look at.
#[derive(Clone, Debug)]
pub(super) struct Admin {
    pub(super) metrics: Metrics,
    pub(super) catalogue: watch::Receiver<Option<Arc<Catalogue>>>,
    pub(super) stopping: watch::Receiver<bool>,
}

impl Admin {
    /// Sizes of the catalogue, if it is loaded.
    fn counts(&self) -> Option<Counts> {
        self.catalogue.borrow().as_ref().map(|catalogue| catalogue.counts())
    }
}

/// Answers until it is dropped.
pub(super) async fn serve(listener: TcpListener, admin: Admin) {
    let routes = Router::new()
        .route("/livez", get(|| async { "ok\n" }))
        .route("/readyz", get(ready))
        .route("/metrics", get(metrics))
        .with_state(admin);
    if let Err(error) = axum::serve(AdminListener::new(listener), routes).await {
        tracing::error!(%error, "probes and metrics are no longer answered");
    }
}

/// Ready while calls are answered: from when the catalogue is loaded until the server stops. Says
/// how many bodies are still to be proven; calls that need them wait.
async fn ready(State(admin): State<Admin>) -> impl IntoResponse {
    if *admin.stopping.borrow() {
        return (StatusCode::SERVICE_UNAVAILABLE, "stopping\n".to_owned());
    }
    let Some(Counts { bodies, unproven_bodies, damaged_bodies, .. }) = admin.counts() else {
        return (StatusCode::SERVICE_UNAVAILABLE, "loading the catalogue\n".to_owned());
    };
    let mut said = "ok\n".to_owned();
    let [one, many] = ["is", "are"].map(|verb| format!("of {bodies} bodies {verb}"));
    if unproven_bodies > 0 {
        said += &format!("{} still to be proven\n", counted(unproven_bodies, &one, &many));
    }
    if damaged_bodies > 0 {
        said += &format!("{} damaged and not used; see the log\n", counted(damaged_bodies, &one, &many));
    }
    (StatusCode::OK, said)
}

async fn metrics(State(admin): State<Admin>) -> impl IntoResponse {
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    ([(header::CONTENT_TYPE, kind)], admin.metrics.text(admin.counts()))
}
