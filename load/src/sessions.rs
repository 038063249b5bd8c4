//! The robots: each has one session at a time with one object, closes it, and starts the next one.
//!
//! A robot does not wait for the answer to a reading before it sends the next one, as on a
//! real arm. It does wait for the start of its session, and for its last answers before it
//! closes it; and, if polite, as long as `Retry-After` says.
//!
//! Robots of a fleet do not touch in step, and neither do these: their first sessions differ in
//! the number of readings. Otherwise all would start, search and close at once, and the latency
//! would be that of these waves.

use std::sync::Arc;
use std::time::{Duration, Instant};

use palpate_core::pose::Pose;
use palpate_core::rng::{Purpose, Stream};
use palpate_schemas::{AddReadings, AskNextTouches, CreateSession, Stamp};
use uuid::Uuid;

use super::LoadConfig;
use super::operation::Operation;
use super::tally::Answer;
use super::touches::{SENSOR, Touches};

/// Largest distance of objects from the session frame's origin, metres.
const PLACE: f64 = 0.2;

/// All robots.
pub(super) struct Sessions {
    robots: Vec<Robot>,
    next: usize,
    readings_max: u32,
    touches: Arc<Touches>,
    create: CreateSession,
    begun: Instant,
}

/// A request of a robot.
pub(super) struct Errand {
    pub(super) robot: usize,
    pub(super) operation: Operation,
    pub(super) request: Request,
}

/// A request to send.
pub(super) enum Request {
    Create(Box<CreateSession>),
    Reading(Uuid, AddReadings),
    Belief(Uuid),
    NextTouches(Uuid, AskNextTouches),
    Close(Uuid),
}

struct Robot {
    name: String,
    session: Option<Uuid>,
    stream: Stream,
    object: usize,
    session_from_object: Pose,
    seq: u64,
    /// Readings of its present or next session.
    readings: u32,
    /// Accepted readings of the session, and finally failed ones.
    accepted: u32,
    failed: u32,
    readings_under_way: u32,
    under_way: u32,
    /// Whether its session is being started or closed.
    is_turning: bool,
    waits_until: Option<Instant>,
}

impl Sessions {
    pub(super) fn new(config: &LoadConfig, touches: Touches) -> Self {
        let readings_max = config.readings_per_session.max(1);
        let robot = |number: usize| {
            let readings = 1 + number as u32 % readings_max;
            Robot::new(number, readings, config.seed, touches.n_objects())
        };
        let robots = (0..config.sessions.max(1)).map(robot).collect();
        let create = CreateSession {
            catalogue: Some(config.catalogue.clone()),
            method: config.method,
            ..CreateSession::default()
        };
        let (touches, begun) = (Arc::new(touches), Instant::now());
        Self { robots, next: 0, readings_max, touches, create, begun }
    }

    /// The next robot in turn that can send the `wanted` request, and its request: that one,
    /// or one that must come before. `None` without such a robot. `due` is the time at which
    /// it was due.
    pub(super) fn take(&mut self, wanted: Operation, due: Instant) -> Option<Errand> {
        let n = self.robots.len();
        let robot = (0..n)
            .map(|step| (self.next + step) % n)
            .find(|robot| self.robots[*robot].operation(wanted, due).is_some())?;
        self.next = (robot + 1) % n;
        let operation = self.robots[robot].operation(wanted, due)?;
        Some(Errand { robot, operation, request: self.request(robot, operation, due) })
    }

    fn request(&mut self, robot: usize, operation: Operation, due: Instant) -> Request {
        let n_objects = self.touches.n_objects();
        let stamp = stamp(due.saturating_duration_since(self.begun));
        let robot = &mut self.robots[robot];
        robot.under_way += 1;
        let session = match (operation, robot.session) {
            (Operation::Create, _) | (_, None) => {
                robot.turn(n_objects);
                return Request::Create(Box::new(self.create.clone()));
            }
            (_, Some(session)) => session,
        };
        match operation {
            Operation::Reading => Request::Reading(session, robot.reading(&self.touches, stamp)),
            Operation::NextTouches => {
                let sensor = SENSOR.name().to_owned();
                Request::NextTouches(session, AskNextTouches { sensor, ..Default::default() })
            }
            Operation::Close => {
                robot.is_turning = true;
                Request::Close(session)
            }
            Operation::Belief | Operation::Create => Request::Belief(session),
        }
    }

    /// Registers an answer; `created` is the new session.
    pub(super) fn answered(
        &mut self,
        robot: usize,
        operation: Operation,
        answer: &Answer,
        created: Option<Uuid>,
        waits_until: Option<Instant>,
    ) {
        let readings_max = self.readings_max;
        let robot = &mut self.robots[robot];
        robot.under_way -= 1;
        robot.waits_until = robot.waits_until.max(waits_until);
        let is_refused = matches!(answer, Answer::Refused { .. });
        match operation {
            Operation::Create => {
                robot.session = created;
                robot.is_turning = false;
            }
            // A missing session need not be closed either.
            Operation::Close => {
                robot.session = robot.session.filter(|_| is_refused);
                robot.is_turning = false;
                if robot.session.is_none() {
                    robot.readings = readings_max;
                }
            }
            Operation::Reading => {
                robot.readings_under_way -= 1;
                match answer {
                    Answer::Accepted => robot.accepted += 1,
                    Answer::Refused { .. } => {}
                    // The session ended: this robot starts another one.
                    Answer::Other { status: 404 | 409 | 410, .. } => robot.failed = robot.readings,
                    Answer::Other { .. } | Answer::Lost { .. } => robot.failed += 1,
                }
            }
            Operation::Belief | Operation::NextTouches => {}
        }
    }

    /// The open sessions.
    pub(super) fn open(&self) -> Vec<Uuid> {
        self.robots.iter().filter_map(|robot| robot.session).collect()
    }
}

impl Robot {
    fn new(number: usize, readings: u32, seed: u64, n_objects: usize) -> Self {
        Self {
            name: format!("load-{number}"),
            session: None,
            stream: Stream::new(seed, Purpose::ObjectPose, number as u64),
            object: number % n_objects,
            session_from_object: Pose::IDENTITY,
            seq: 0,
            readings,
            accepted: 0,
            failed: 0,
            readings_under_way: 0,
            under_way: 0,
            is_turning: false,
            waits_until: None,
        }
    }

    /// The request that the robot sends when `wanted` is due, if any.
    fn operation(&self, wanted: Operation, now: Instant) -> Option<Operation> {
        if self.is_turning || self.waits_until.is_some_and(|until| until > now) {
            return None;
        }
        let done = self.accepted + self.failed;
        match (self.session, wanted) {
            (None, _) => (self.under_way == 0).then_some(Operation::Create),
            (Some(_), _) if done >= self.readings => {
                (self.under_way == 0).then_some(Operation::Close)
            }
            (Some(_), Operation::Reading) => {
                (done + self.readings_under_way < self.readings).then_some(Operation::Reading)
            }
            (Some(_), Operation::NextTouches) => {
                (self.accepted > 0).then_some(Operation::NextTouches)
            }
            (Some(_), wanted) => Some(wanted),
        }
    }

    /// Changes to another object at another pose.
    fn turn(&mut self, n_objects: usize) {
        self.is_turning = true;
        self.object = self.stream.index(n_objects);
        let translation = PLACE * self.stream.direction();
        self.session_from_object = Pose::from_parts(self.stream.rotation(), translation);
        (self.accepted, self.failed, self.readings_under_way) = (0, 0, 0);
    }

    fn reading(&mut self, touches: &Touches, stamp: Stamp) -> AddReadings {
        let mut reading = touches.draw(self.object, self.session_from_object, &mut self.stream);
        reading.robot = Some(self.name.clone());
        reading.seq = Some(self.seq);
        reading.stamp = Some(stamp);
        self.seq += 1;
        self.readings_under_way += 1;
        AddReadings { readings: vec![reading] }
    }
}

/// A time since the start of the run, on a simulated clock that starts at 0.
fn stamp(since: Duration) -> Stamp {
    Stamp { sec: since.as_secs(), nanosec: since.subsec_nanos() }
}

#[cfg(test)]
mod tests {
    use std::collections::VecDeque;

    use palpate_core::reading::{Reading, SensorId};
    use palpate_core::sensor::SensorDescription;

    use super::*;
    use crate::operation::Mix;
    use crate::schedule::Arrivals;

    /// Sessions whose requests are each answered after two more were sent: the robots' requests.
    fn requests(sessions: usize, n: usize) -> Vec<Operation> {
        let sensor = SensorDescription::digitacts_6x6();
        let reading = Reading::new(SensorId(1), &sensor, &[Some(0.0); 36], Pose::IDENTITY).unwrap();
        let config = LoadConfig {
            seed: 1,
            catalogue: "load".to_owned(),
            method: None,
            belief: palpate_schemas::BeliefDetail::Full,
            rates: vec![1.0],
            arrivals: Arrivals::Constant,
            duration: Duration::from_secs(1),
            warmup: Duration::ZERO,
            soak: None,
            sessions,
            readings_per_session: 10,
            mix: Mix { readings: 1.0, beliefs: 0.0, next_touches: 0.0 },
            in_flight_max: 8,
            polite: false,
        };
        let mut robots = Sessions::new(&config, Touches::new(vec![vec![reading]]).unwrap());
        let (mut under_way, mut sent) = (VecDeque::new(), Vec::new());
        for _ in 0..n {
            let errand = robots.take(Operation::Reading, Instant::now()).unwrap();
            sent.push(errand.operation);
            under_way.push_back((errand.robot, errand.operation));
            if under_way.len() > 2 {
                let (robot, operation) = under_way.pop_front().unwrap();
                let created = (operation == Operation::Create).then(Uuid::now_v7);
                robots.answered(robot, operation, &Answer::Accepted, created, None);
            }
        }
        sent
    }

    #[test]
    fn robots_do_not_touch_in_step() {
        let sent = requests(60, 6_000);
        // In each round of 60 requests a tenth of the robots start a session or end one; in step
        // all would at once.
        for round in sent[1_200..].chunks(60) {
            let n = |kind| round.iter().filter(|it| **it == kind).count();
            let (starts, ends) = (n(Operation::Create), n(Operation::Close));
            assert!(starts <= 8 && ends <= 8, "{starts} starts, {ends} ends");
        }
    }

    #[test]
    fn sessions_after_the_first_have_all_their_readings() {
        let sent = requests(4, 2_000);
        let n = |kind| sent[100..].iter().filter(|it| **it == kind).count() as f64;
        let readings_per_session = n(Operation::Reading) / n(Operation::Create);
        assert!((readings_per_session - 10.0).abs() < 0.2, "{readings_per_session}");
    }
}
