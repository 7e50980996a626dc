//! The listener for operators: probes and metrics over HTTP/1, apart from the calls.

use std::sync::Arc;

use axum::Router;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::IntoResponse;
use axum::routing::get;
use tokio::net::TcpListener;
use tokio::sync::watch;

use super::metrics::Metrics;
use crate::store::Catalogue;

/// What the probes look at.
#[derive(Clone, Debug)]
pub(super) struct Admin {
    pub(super) metrics: Metrics,
    pub(super) catalogue: watch::Receiver<Option<Arc<Catalogue>>>,
    pub(super) stopping: watch::Receiver<bool>,
}

/// Answers until it is dropped.
pub(super) async fn serve(listener: TcpListener, admin: Admin) {
    let routes = Router::new()
        .route("/livez", get(|| async { "ok\n" }))
        .route("/readyz", get(ready))
        .route("/metrics", get(metrics))
        .with_state(admin);
    if let Err(error) = axum::serve(listener, routes).await {
        tracing::error!(%error, "probes and metrics are no longer answered");
    }
}

/// Ready while calls are answered: from when the catalogue is loaded until the server stops.
async fn ready(State(admin): State<Admin>) -> impl IntoResponse {
    if *admin.stopping.borrow() {
        (StatusCode::SERVICE_UNAVAILABLE, "stopping\n")
    } else if admin.catalogue.borrow().is_none() {
        (StatusCode::SERVICE_UNAVAILABLE, "loading the catalogue\n")
    } else {
        (StatusCode::OK, "ok\n")
    }
}

async fn metrics(State(admin): State<Admin>) -> impl IntoResponse {
    let sizes = admin.catalogue.borrow().as_ref().map(|catalogue| catalogue.counts());
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    ([(header::CONTENT_TYPE, kind)], admin.metrics.text(sizes))
}
