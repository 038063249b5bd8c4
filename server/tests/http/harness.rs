//! The harness: a server for one test, and common requests.

use std::net::{Ipv4Addr, SocketAddr};
use std::path::{Path, PathBuf};
use std::time::Duration;

use palpate_core::pose::Pose;
use palpate_core::reading::{Reading, SensorId};
use palpate_core::sensor::SensorDescription;
use palpate_server::{Access, Config, Server};
use palpate_sim::mesh::{Mesh, MeshFormat};
use palpate_sim::press::PressSimulator;
use palpate_sim::sampler::{SamplerConfig, sample};
use reqwest::{Method, StatusCode};
use serde_json::{Value, json};
use tempfile::TempDir;
use tokio::sync::OnceCell;

/// Time after which a request counts as lost. Commissioning with noise in place of touches, the
/// slowest one, took longer than half a minute on a busy machine.
const ANSWER_WITHIN: Duration = Duration::from_secs(180);

/// A running server and its data folder.
pub(crate) struct Harness {
    pub(crate) server: Server,
    pub(crate) client: reqwest::Client,
    /// The key of the requests.
    pub(crate) key: Option<String>,
    folder: TempDir,
}

/// A complete answer.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: StatusCode,
    pub(crate) headers: reqwest::header::HeaderMap,
    pub(crate) text: String,
}

/// The files of a folder that [`Harness::train`] was done in: a training costs more than most
/// tests, and each starts from a copy.
static TRAINED: OnceCell<Vec<(PathBuf, Vec<u8>)>> = OnceCell::const_new();

async fn trained_files() -> Vec<(PathBuf, Vec<u8>)> {
    let it = Harness::start().await;
    it.train().await;
    it.server.shutdown().await;
    let (root, mut files, mut folders) = (it.folder.path(), Vec::new(), vec![PathBuf::new()]);
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(root.join(&folder)).unwrap() {
            let entry = entry.unwrap();
            let path = folder.join(entry.file_name());
            if entry.file_type().unwrap().is_dir() {
                folders.push(path);
            } else {
                files.push((path, std::fs::read(entry.path()).unwrap()));
            }
        }
    }
    files
}

pub(crate) fn config(folder: &Path) -> Config {
    let listen = SocketAddr::from((Ipv4Addr::LOCALHOST, 0));
    Config { listen, ..Config::new(folder) }
}

fn client() -> reqwest::Client {
    // Reqwest needs a provider even when no test speaks TLS.
    let _ = rustls::crypto::ring::default_provider().install_default();
    reqwest::Client::builder().timeout(ANSWER_WITHIN).build().unwrap()
}

impl Harness {
    pub(crate) async fn start() -> Self {
        Self::start_with(|_| {}).await
    }

    pub(crate) async fn start_with(change: impl FnOnce(&mut Config)) -> Self {
        Self::start_in(TempDir::new().unwrap(), change).await
    }

    async fn start_in(folder: TempDir, change: impl FnOnce(&mut Config)) -> Self {
        let mut config = config(folder.path());
        change(&mut config);
        let mut server = Server::start(config).await.unwrap();
        let key = server.take_admin_key();
        Self { server, client: client(), key, folder }
    }

    /// A server that requires keys; requests use the first admin's.
    pub(crate) async fn guarded() -> Self {
        Self::start_with(|config| config.access = Access::Keys).await
    }

    /// A server that has trained a cube and a bar.
    pub(crate) async fn trained() -> Self {
        Self::trained_with(|_| {}).await
    }

    /// The same for a server that requires keys.
    pub(crate) async fn guarded_and_trained() -> Self {
        Self::trained_with(|config| config.access = Access::Keys).await
    }

    /// The same with other settings.
    pub(crate) async fn trained_with(change: impl FnOnce(&mut Config)) -> Self {
        let files = TRAINED.get_or_init(trained_files).await;
        let folder = TempDir::new().unwrap();
        for (path, bytes) in files {
            let path = folder.path().join(path);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, bytes).unwrap();
        }
        Self::start_in(folder, change).await
    }

    /// The secret of a new key.
    pub(crate) async fn new_key(&self, name: &str, role: &str) -> String {
        let created = self.post("/v1/keys", &json!({"name": name, "role": role})).await.expect(201);
        created["secret"].as_str().unwrap().to_owned()
    }

    /// A request with another key, or without one.
    pub(crate) async fn send_as(&self, key: Option<&str>, method: Method, path: &str) -> Answer {
        let mut request = self.client.request(method, self.url(path));
        if let Some(key) = key {
            request = request.bearer_auth(key);
        }
        read(request.send().await.unwrap()).await
    }

    pub(crate) async fn restart(self) -> Self {
        self.restart_with(|_| {}).await
    }

    pub(crate) async fn restart_with(self, change: impl FnOnce(&mut Config)) -> Self {
        self.server.shutdown().await;
        let mut config = config(self.folder.path());
        change(&mut config);
        let server = Server::start(config).await.unwrap();
        Self { server, ..self }
    }

    /// Stops the server, changes its folder, and starts it again.
    pub(crate) async fn restart_after(self, between: impl FnOnce(&Path)) -> Self {
        self.server.shutdown().await;
        between(self.folder.path());
        let server = Server::start(config(self.folder.path())).await.unwrap();
        Self { server, ..self }
    }

    pub(crate) fn folder(&self) -> &Path {
        self.folder.path()
    }

    pub(crate) fn url(&self, path: &str) -> String {
        format!("{}{path}", self.server.address())
    }

    pub(crate) async fn send(
        &self,
        method: Method,
        path: &str,
        body: Option<(&str, Vec<u8>)>,
    ) -> Answer {
        let mut request = self.client.request(method, self.url(path));
        if let Some(key) = &self.key {
            request = request.bearer_auth(key);
        }
        if let Some((content_type, bytes)) = body {
            request = request.header("content-type", content_type).body(bytes);
        }
        read(request.send().await.unwrap()).await
    }

    pub(crate) async fn get(&self, path: &str) -> Answer {
        self.send(Method::GET, path, None).await
    }

    pub(crate) async fn post(&self, path: &str, body: &Value) -> Answer {
        let bytes = body.to_string().into_bytes();
        self.send(Method::POST, path, Some(("application/json", bytes))).await
    }

    pub(crate) async fn put_mesh(&self, object: &str, mesh: &str) -> Answer {
        let path = format!("/v1/objects/{object}/mesh?unit=mm");
        self.send(Method::PUT, &path, Some(("model/off", mesh.into()))).await
    }

    /// Adds a cube and a bar and trains them.
    pub(crate) async fn train(&self) -> Value {
        for (name, size) in [("cube", CUBE), ("bar", BAR)] {
            self.post("/v1/objects", &json!({"name": name})).await.expect(201);
            self.put_mesh(name, &off_box(size)).await.expect(200);
        }
        // Tests press with the description itself.
        let training = json!({"readings_per_object": 60, "n_classes": 8, "seed": 3,
            "sensor_knowledge": "measured"});
        let path = "/v1/catalogues/default/trainings";
        let job = self.post(path, &training).await.expect(202);
        let job = self.finished(job["id"].as_str().unwrap()).await;
        assert_eq!(job["state"], "succeeded", "{job}");
        job
    }

    /// Follows a job's events until it is finished.
    pub(crate) async fn finished(&self, job: &str) -> Value {
        let events = self.get(&format!("/v1/jobs/{job}/events")).await;
        let last = events.text.lines().rev().find_map(|line| line.strip_prefix("data: "));
        serde_json::from_str(last.unwrap()).unwrap()
    }

    pub(crate) async fn session(&self, request: Value) -> String {
        let session = self.post("/v1/sessions", &request).await.expect(201);
        session["id"].as_str().unwrap().to_owned()
    }
}

impl Answer {
    pub(crate) fn json(&self) -> Value {
        serde_json::from_str(&self.text).unwrap_or_else(|_| panic!("not JSON: {self:?}"))
    }

    #[track_caller]
    pub(crate) fn expect(&self, status: u16) -> Value {
        assert_eq!(self.status.as_u16(), status, "{self:?}");
        if self.text.is_empty() { Value::Null } else { self.json() }
    }

    /// Checks the status, type and field of a problem.
    #[track_caller]
    pub(crate) fn problem(&self, status: u16, kind: &str, pointer: Option<&str>) -> Value {
        let problem = self.expect(status);
        assert_eq!(self.headers["content-type"], "application/problem+json");
        assert_eq!(problem["status"], status);
        assert_eq!(problem["type"], format!("urn:palpate:problem:{kind}"), "{problem}");
        assert_eq!(problem["request_id"], self.headers["x-request-id"].to_str().unwrap());
        if let Some(pointer) = pointer {
            let errors = problem["errors"].as_array().unwrap();
            let named = errors.iter().any(|error| error["pointer"] == pointer);
            assert!(named, "{pointer} is not named in {problem}");
        }
        problem
    }
}

pub(crate) async fn read(response: reqwest::Response) -> Answer {
    let (status, headers) = (response.status(), response.headers().clone());
    Answer { status, headers, text: response.text().await.unwrap() }
}

/// A belief without the fields that depend on the time of arrival.
pub(crate) fn content(belief: &Value) -> Value {
    let mut belief = belief.clone();
    belief["revision"] = Value::Null;
    belief["session"] = Value::Null;
    belief
}

/// Edges in millimetres.
pub(crate) const CUBE: [f64; 3] = [40.0, 40.0, 40.0];
pub(crate) const BAR: [f64; 3] = [80.0, 20.0, 20.0];

/// A box as an OFF file.
pub(crate) fn off_box([x, y, z]: [f64; 3]) -> String {
    let mut file = String::from("OFF\n8 6 0\n");
    for corner in 0..8 {
        let at = |bit: usize, edge: f64| if corner & bit == 0 { -edge / 2.0 } else { edge / 2.0 };
        file += &format!("{} {} {}\n", at(1, x), at(2, y), at(4, z));
    }
    file + "4 0 2 3 1\n4 4 5 7 6\n4 0 1 5 4\n4 2 6 7 3\n4 0 4 6 2\n4 1 3 7 5\n"
}

/// Simulated touches of a box at rest at `session_from_object`, in wire form.
pub(crate) fn touches(
    size: [f64; 3],
    n: usize,
    seed: u64,
    session_from_object: Pose,
) -> Vec<Value> {
    touches_by("digitacts-6x6", size, n, seed, session_from_object)
}

/// The same by a sensor of a preset.
pub(crate) fn touches_by(
    preset: &str,
    size: [f64; 3],
    n: usize,
    seed: u64,
    session_from_object: Pose,
) -> Vec<Value> {
    let mesh = Mesh::from_bytes(MeshFormat::Off, off_box(size).as_bytes(), 1e-3).unwrap();
    let simulator = PressSimulator::new(mesh, SensorDescription::preset_named(preset).unwrap());
    let config = SamplerConfig::for_simulator(&simulator);
    let mut go_on = |_, _| std::ops::ControlFlow::Continue(());
    let readings = sample(&simulator, SensorId(1), n, seed, &config, &mut go_on).unwrap();
    let wire = |reading: &Reading| wire_of(preset, &reading.moved_by(session_from_object));
    readings.iter().map(wire).collect()
}

/// A simulated reading of the usual preset in wire form.
pub(crate) fn wire(reading: &Reading) -> Value {
    wire_of("digitacts-6x6", reading)
}

fn wire_of(preset: &str, reading: &Reading) -> Value {
    let pose = reading.sent_pose();
    json!({
        "sensor": preset,
        "pose": {
            "position": pose.translation.to_array(),
            "orientation": pose.rotation.to_array(),
        },
        "image": reading.values(),
    })
}

/// A pose of an answer.
pub(crate) fn pose_of(value: &Value) -> Pose {
    let part = |name: &str| value[name].clone();
    let position = serde_json::from_value(part("position")).unwrap();
    Pose::new(position, serde_json::from_value(part("orientation")).unwrap()).unwrap()
}

/// A valid reading without contact.
pub(crate) fn quiet_reading() -> Value {
    json!({
        "sensor": "digitacts-6x6",
        "pose": {"position": [0.0, 0.0, 0.1], "orientation": [0.0, 0.0, 0.0, 1.0]},
        "image": vec![0.0; 36],
    })
}
