//! The HTTP API and the page: one file a resource, one error shape, no triangle. What it
//! tells of itself (`/api/v1/openapi.json`) is made of the same attributes as its routes.

mod analysis;
mod assets;
mod auth;
mod boards;
mod caching;
mod charts;
mod columnar;
mod compare;
mod dto;
mod events;
mod input;
mod limits;
mod ops;
mod problem;
mod run;
mod runs;
mod server;
mod state;
mod studies;
mod submit;
mod uploads;
mod views;

use axum::extract::DefaultBodyLimit;
use axum::routing::get;
use axum::{Router, middleware};
pub use state::{App, Config, Shared};
use tower_http::CompressionLevel;
use tower_http::catch_panic::CatchPanicLayer;
use tower_http::compression::CompressionLayer;
use tower_http::compression::predicate::{NotForContentType, Predicate, SizeAbove};
use utoipa::OpenApi;
use utoipa::openapi::security::{Http, HttpAuthScheme, SecurityScheme};
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;

/// Manifests are text: more is a mistake.
const BODY_BYTES: usize = 4 << 20;

#[derive(OpenApi)]
#[openapi(
    info(title = "cullmark", description = "Submit studies of visibility culling, watch them, and take results away. See docs/API.md."),
    servers((url = "/api/v1")),
    components(schemas(problem::Problem, problem::Mistake)),
    security(("token" = []), ())
)]
struct Document;

fn routes() -> OpenApiRouter<Shared> {
    OpenApiRouter::with_openapi(Document::openapi())
        .routes(routes!(studies::list, submit::submit))
        .routes(routes!(studies::one, studies::change, studies::delete))
        .routes(routes!(studies::pause))
        .routes(routes!(studies::resume))
        .routes(routes!(studies::cancel))
        .routes(routes!(studies::retry))
        .routes(routes!(submit::rerun))
        .routes(routes!(studies::manifest))
        .routes(routes!(events::events))
        .routes(routes!(studies::metrics))
        .routes(routes!(runs::runs))
        .routes(routes!(runs::matrix))
        .routes(routes!(run::run))
        .routes(routes!(run::series))
        .routes(routes!(analysis::front))
        .routes(routes!(analysis::claims_route))
        .routes(routes!(charts::chart_list))
        .routes(routes!(charts::chart))
        .routes(routes!(compare::compare_route))
        .routes(routes!(uploads::list, uploads::upload))
        .routes(routes!(uploads::delete))
        .routes(routes!(views::about))
        .routes(routes!(views::mesh))
        .routes(routes!(views::nodes))
        .routes(routes!(views::frame))
        .routes(routes!(views::depth))
        .routes(routes!(views::upload_about))
        .routes(routes!(views::upload_mesh))
        .routes(routes!(server::me))
        .routes(routes!(server::pool))
        .routes(routes!(server::pause))
        .routes(routes!(server::resume))
        .routes(routes!(server::machine))
        .routes(routes!(server::examples))
}

/// The description of all routes, as JSON.
///
/// # Panics
/// Never: the document is plain data.
pub fn openapi() -> String {
    let (_, mut document) = routes().split_for_parts();
    let token = SecurityScheme::Http(Http::new(HttpAuthScheme::Bearer));
    document.components.get_or_insert_default().add_security_scheme("token", token);
    document.to_pretty_json().expect("the document is plain data")
}

/// Everything that the server answers.
pub fn router(app: Shared) -> Router {
    let (api, _) = routes().split_for_parts();
    let document = openapi();
    let openapi = move || {
        let document = document.clone();
        async move { ([(axum::http::header::CONTENT_TYPE, "application/json")], document) }
    };
    // Meshes go to this machine mostly, and pictures are compressed already; events must not wait.
    let packed = SizeAbove::new(1024)
        .and(NotForContentType::new("text/event-stream"))
        .and(NotForContentType::new("application/octet-stream"))
        .and(NotForContentType::new("image/png"));
    let api = api
        .route("/openapi.json", get(openapi))
        .method_not_allowed_fallback(|| async {
            problem::Problem::new(axum::http::StatusCode::METHOD_NOT_ALLOWED, "this address does not take that method")
                .help("routes: /api/v1/openapi.json")
        })
        .layer(DefaultBodyLimit::max(BODY_BYTES))
        .layer(middleware::from_fn_with_state(app.clone(), limits::time))
        .layer(middleware::from_fn_with_state(app.clone(), limits::rate));
    Router::new()
        .nest("/api/v1", api)
        .route("/healthz", get(ops::healthz))
        .route("/metrics", get(ops::metrics))
        .fallback(assets::asset)
        // Level 6 of the usual takes longer than making the answer did.
        .layer(CompressionLayer::new().quality(CompressionLevel::Fastest).compress_when(packed))
        .layer(middleware::from_fn_with_state(app.clone(), auth::guard))
        .layer(middleware::from_fn_with_state(app.clone(), ops::log))
        .layer(middleware::from_fn(limits::drain))
        .layer(CatchPanicLayer::custom(limits::panicked))
        .layer(middleware::from_fn(assets::headers))
        .with_state(app)
}

/// Serves until `phase` says to end; open requests are answered first.
///
/// # Errors
/// When the socket fails.
pub async fn serve(app: Shared, listener: tokio::net::TcpListener) -> std::io::Result<()> {
    let mut phase = app.phase.clone();
    let ended = async move {
        let _ = phase.wait_for(|p| *p != crate::worker::Phase::Work).await;
    };
    let views = app.clone();
    let tidy = tokio::spawn(async move {
        loop {
            tokio::time::sleep(std::time::Duration::from_secs(10)).await;
            views.views.tidy();
            let _ = tokio::task::spawn_blocking(crate::machine::give_back_memory).await;
        }
    });
    uploads::sweep(&app.config.upload_dir);
    let service = router(app).into_make_service_with_connect_info::<std::net::SocketAddr>();
    let done = axum::serve(listener, service).with_graceful_shutdown(ended).await;
    tidy.abort();
    done
}

fn now_ms() -> i64 {
    jiff::Timestamp::now().as_millisecond()
}

fn utc(ms: i64) -> String {
    jiff::Timestamp::from_millisecond(ms).map(|t| t.strftime("%Y-%m-%dT%H:%M:%SZ").to_string()).unwrap_or_default()
}
