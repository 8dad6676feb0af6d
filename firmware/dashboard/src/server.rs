//! The server: one thread, one small runtime, bounded in connections, viewers, bytes and time.

use crate::access::{Access, AccessError, Rights};
use crate::flight::{Event, Flight, Scene, json};
use crate::order::{Command, Order};
use crate::page;
use axum::body::Body;
use axum::extract::{DefaultBodyLimit, Request, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::middleware::{self, Next};
use axum::response::sse::{self, KeepAlive, Sse};
use axum::response::{Html, IntoResponse, Response};
use axum::routing::{get, post};
use axum::{Json, Router};
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use std::convert::Infallible;
use std::io;
use std::net::{SocketAddr, TcpListener};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};
use thiserror::Error;
use tokio::sync::{Semaphore, broadcast, mpsc};
use tokio_stream::wrappers::BroadcastStream;
use tokio_stream::{Stream, StreamExt as _};

/// Events that may wait for the server's thread: ten seconds of a busy flight.
const EVENTS_WAITING: usize = 256;
/// Events that a slow viewer may lag behind; after that its stream ends, and the page starts over.
const VIEWER_LAG: usize = 256;
/// Orders that may wait for the decision loop.
const ORDERS_WAITING: usize = 8;
/// Open connections; a new one waits until one closes.
const CONNECTIONS: usize = 64;
/// Streams of events.
const VIEWERS: usize = 16;
/// Largest body of a request, bytes.
const BODY_BYTES: usize = 1024;
/// Longest time for the headers of a request, and for everything up to the first byte of its answer.
const HEADER_TIME: Duration = Duration::from_secs(5);
const ANSWER_TIME: Duration = Duration::from_secs(6);
/// Shortest time between two commands, and the longest that one may wait for its turn.
const COMMAND_INTERVAL: Duration = Duration::from_millis(100);
const COMMAND_WAIT: Duration = Duration::from_secs(1);

/// Why there is no page.
#[derive(Debug, Error)]
pub enum ServerError {
    /// The address is open and the rule has no tokens.
    #[error(transparent)]
    Access(#[from] AccessError),
    /// The address cannot be listened at.
    #[error("cannot serve the page at {address}: {source}; choose another port")]
    Bind {
        /// The address.
        address: SocketAddr,
        /// The system's reason.
        source: io::Error,
    },
    /// The thread or its runtime could not start.
    #[error("cannot start the page's server: {0}")]
    Start(io::Error),
}

/// The handle of the decision loop: no call of it waits.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    access: Access,
    events: mpsc::Sender<Event>,
    orders: mpsc::Receiver<Order>,
    dropped: u64,
}

struct Shared {
    flight: Mutex<Flight>,
    stream: broadcast::Sender<Message>,
    orders: mpsc::Sender<Order>,
    access: Access,
    viewers: Arc<Semaphore>,
    next_command: Mutex<Instant>,
}

impl Shared {
    /// Reserves the next place in the row of commands: the time until it, or `None` where that is too far away.
    fn reserve_command(&self, now: Instant) -> Option<Duration> {
        let mut next = self.next_command.lock().unwrap_or_else(PoisonError::into_inner);
        let place = (*next).max(now);
        let wait = place - now;
        (wait <= COMMAND_WAIT).then(|| {
            *next = place + COMMAND_INTERVAL;
            wait
        })
    }
}

/// An encoded event, ready for every viewer.
type Message = (&'static str, Arc<str>);

/// Publishes events from another thread. No call of it waits.
#[derive(Clone, Debug)]
pub(crate) struct Publisher {
    events: mpsc::Sender<Event>,
}

/// The address of `--http`: a port of this computer only, or ADDRESS:PORT.
///
/// # Errors
/// The text is neither; the message says how to write it.
pub fn http_address(text: &str) -> Result<SocketAddr, String> {
    let (host, port) = text.rsplit_once(':').unwrap_or(("127.0.0.1", text));
    let host = if host == "localhost" { "127.0.0.1" } else { host };
    format!("{host}:{port}").parse().map_err(|_| {
        format!(
            "{text:?} is no address of a page: write a port, as in 8080, or ADDRESS:PORT, as in 0.0.0.0:8080"
        )
    })
}

impl Publisher {
    /// An event that finds the channel full is dropped.
    pub fn publish(&self, event: Event) {
        let _ = self.events.try_send(event);
    }
}

impl Server {
    /// Listens at `address` and serves the page. Port 0 takes a free one: see [`Server::address`].
    ///
    /// # Errors
    /// See [`ServerError`].
    pub fn start(address: SocketAddr, access: Access, scene: Scene) -> Result<Server, ServerError> {
        access.check(address)?;
        let bind = |source| ServerError::Bind { address, source };
        let listener = TcpListener::bind(address).map_err(bind)?;
        listener.set_nonblocking(true).map_err(bind)?;
        let address = listener.local_addr().map_err(bind)?;
        let (events, received) = mpsc::channel(EVENTS_WAITING);
        let (orders, taken) = mpsc::channel(ORDERS_WAITING);
        let shared = Arc::new(Shared {
            flight: Mutex::new(Flight::new(scene)),
            stream: broadcast::channel(VIEWER_LAG).0,
            orders,
            access: access.clone(),
            viewers: Arc::new(Semaphore::new(VIEWERS)),
            next_command: Mutex::new(Instant::now()),
        });
        let runtime = tokio::runtime::Builder::new_current_thread()
            .enable_io()
            .enable_time()
            .build()
            .map_err(ServerError::Start)?;
        std::thread::Builder::new()
            .name("dashboard".into())
            .spawn(move || runtime.block_on(serve(listener, received, shared)))
            .map_err(ServerError::Start)?;
        Ok(Server { address, access, events, orders: taken, dropped: 0 })
    }

    /// Where the page is.
    #[must_use]
    pub const fn address(&self) -> SocketAddr {
        self.address
    }

    /// Hands an event to the server's thread. When that is behind, the event is dropped and counted.
    pub fn publish(&mut self, event: Event) {
        if self.events.try_send(event).is_err() {
            self.dropped += 1;
        }
    }

    /// Publishes from another thread. The server ends when the handle and all publishers are dropped.
    pub(crate) fn publisher(&self) -> Publisher {
        Publisher { events: self.events.clone() }
    }

    /// The addresses to open, each with the right that it gives.
    #[must_use]
    pub fn links(&self) -> Vec<(&'static str, String)> {
        let host = match self.address.ip().is_unspecified() {
            true => "THIS-COMPUTER".to_owned(),
            false if self.address.is_ipv6() => format!("[{}]", self.address.ip()),
            false => self.address.ip().to_string(),
        };
        let page = format!("http://{host}:{}/", self.address.port());
        match &self.access {
            Access::Loopback => vec![("page", page)],
            Access::Tokens { view, control } => vec![
                ("page to view", format!("{page}#token={}", view.secret())),
                ("page to control", format!("{page}#token={}", control.secret())),
            ],
        }
    }

    /// The next order of a viewer.
    pub fn order(&mut self) -> Option<Order> {
        self.orders.try_recv().ok()
    }

    /// Events that were dropped.
    #[must_use]
    pub const fn dropped(&self) -> u64 {
        self.dropped
    }
}

/// Runs until the handle and the publishers are dropped.
async fn serve(listener: TcpListener, mut events: mpsc::Receiver<Event>, shared: Arc<Shared>) {
    // Only fails outside a runtime.
    let Ok(listener) = tokio::net::TcpListener::from_std(listener) else { return };
    let connections = tokio::spawn(accept(listener, router(Arc::clone(&shared))));
    while let Some(event) = events.recv().await {
        let (kind, data) = event.encode();
        // Under one lock, so that a new viewer gets each event once: in the flight or in the stream.
        let mut flight = shared.flight.lock().unwrap_or_else(PoisonError::into_inner);
        flight.add(event);
        // No viewers is no error.
        let _ = shared.stream.send((kind, data.into()));
    }
    connections.abort();
}

async fn accept(listener: tokio::net::TcpListener, router: Router) {
    let places = Arc::new(Semaphore::new(CONNECTIONS));
    loop {
        let Ok(place) = Arc::clone(&places).acquire_owned().await else { return };
        let Ok((stream, _)) = listener.accept().await else {
            // Out of descriptors: some close within a moment.
            tokio::time::sleep(Duration::from_millis(100)).await;
            continue;
        };
        let service = TowerToHyperService::new(router.clone());
        tokio::spawn(async move {
            let connection = http1::Builder::new()
                .timer(TokioTimer::new())
                .header_read_timeout(HEADER_TIME)
                .max_buf_size(16 * 1024)
                .serve_connection(TokioIo::new(stream), service);
            // A connection that ends early is its viewer's.
            let _ = connection.await;
            drop(place);
        });
    }
}

fn router(shared: Arc<Shared>) -> Router {
    let guarded = Router::new()
        .route("/api/events", get(follow))
        .route("/api/command", post(command))
        .route_layer(middleware::from_fn_with_state(Arc::clone(&shared), admit));
    Router::new()
        .route("/", get(index))
        .merge(guarded)
        .layer(DefaultBodyLimit::max(BODY_BYTES))
        .layer(middleware::from_fn(within_time))
        .with_state(shared)
}

/// The page holds no secret: it asks for the flight with the token in its own address.
async fn index() -> Response {
    let mut response = Html(page::live()).into_response();
    let policy = HeaderValue::from_str(&page::security_policy())
        .unwrap_or(HeaderValue::from_static("default-src 'none'"));
    let headers = response.headers_mut();
    headers.insert(header::CONTENT_SECURITY_POLICY, policy);
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    headers.insert(header::REFERRER_POLICY, HeaderValue::from_static("no-referrer"));
    headers.insert(header::CACHE_CONTROL, HeaderValue::from_static("no-store"));
    response
}

/// Lets a request pass that has the right it needs.
async fn admit(State(shared): State<Arc<Shared>>, request: Request, next: Next) -> Response {
    let Rights { view, control } = shared.access.rights(request.headers());
    let needs_control = request.uri().path() == "/api/command";
    match (view, control) {
        (false, _) => (StatusCode::UNAUTHORIZED, "access token missing or wrong").into_response(),
        (true, false) if needs_control => {
            (StatusCode::FORBIDDEN, "this address may look, not command").into_response()
        }
        _ => next.run(request).await,
    }
}

async fn within_time(request: Request, next: Next) -> Response {
    let answer = tokio::time::timeout(ANSWER_TIME, next.run(request)).await;
    answer.unwrap_or_else(|_| (StatusCode::REQUEST_TIMEOUT, "too slow").into_response())
}

/// The flight so far, then its events.
async fn follow(State(shared): State<Arc<Shared>>) -> Result<Response<Body>, (StatusCode, &'static str)> {
    let place = Arc::clone(&shared.viewers)
        .try_acquire_owned()
        .map_err(|_| (StatusCode::SERVICE_UNAVAILABLE, "too many viewers"))?;
    let (flight, events) = {
        let flight = shared.flight.lock().unwrap_or_else(PoisonError::into_inner);
        (json(&*flight), shared.stream.subscribe())
    };
    let first = tokio_stream::once(("flight", Arc::<str>::from(flight)));
    let stream = first.chain(until_lagging(events)).map(move |(kind, data)| {
        // Held as long as the stream.
        let _ = &place;
        Ok::<_, Infallible>(sse::Event::default().event(kind).data(data))
    });
    Ok(Sse::new(stream).keep_alive(KeepAlive::default()).into_response())
}

/// The events until some were missed: the viewer then starts over with the whole flight.
fn until_lagging(events: broadcast::Receiver<Message>) -> impl Stream<Item = Message> {
    BroadcastStream::new(events).map_while(Result::ok)
}

/// Hands a command to the decision loop and waits for what it answers.
async fn command(State(shared): State<Arc<Shared>>, Json(command): Json<Command>) -> Response {
    if let Command::Preference(w_data) = command
        && !(0.0..=1.0).contains(&w_data)
    {
        return (StatusCode::BAD_REQUEST, "the preference is a number from 0 to 1").into_response();
    }
    let Some(wait) = shared.reserve_command(Instant::now()) else {
        return (StatusCode::TOO_MANY_REQUESTS, "too many commands, wait a moment").into_response();
    };
    tokio::time::sleep(wait).await;
    let (order, answered) = Order::new(command);
    if shared.orders.try_send(order).is_err() {
        return (StatusCode::SERVICE_UNAVAILABLE, "the program is busy with earlier commands")
            .into_response();
    }
    match answered.await {
        Ok(words) => Json(serde_json::json!({ "words": words })).into_response(),
        Err(_) => (StatusCode::SERVICE_UNAVAILABLE, "the program has stopped").into_response(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_a_port_or_an_address_with_a_port() {
        for (text, address) in [
            ("8080", "127.0.0.1:8080"),
            ("localhost:80", "127.0.0.1:80"),
            ("0.0.0.0:8080", "0.0.0.0:8080"),
            ("[::1]:9", "[::1]:9"),
        ] {
            assert_eq!(http_address(text), Ok(address.parse().unwrap()));
        }
        for wrong in ["", "drone", "127.0.0.1", "127.0.0.1:70000", "http://127.0.0.1:80"] {
            assert!(http_address(wrong).unwrap_err().contains("write a port"), "{wrong}");
        }
    }
}
