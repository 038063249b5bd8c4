//! The members that are alive, by what they told and when.
//!
//! A member is alive for a few seconds after its last hello. One that says that it leaves, or
//! that no longer listens, is gone at once. Times are arguments.

use std::collections::BTreeMap;
use std::time::{Duration, Instant};

use uuid::Uuid;

use super::placing::{Block, Seat};
use super::words::Hello;

/// Time after its last hello in which a member counts as alive. Chosen: four hellos may be lost.
const ALIVE_WITHIN: Duration = Duration::from_secs(5);
/// Number of members known at a time. Chosen: far more than share a cluster.
const MEMBERS_MAX: usize = 1000;

/// What the other members told.
#[derive(Debug)]
pub(super) struct Roster {
    own: Seat,
    /// Hash of this program; members with another one are not asked.
    program: String,
    heard: BTreeMap<Uuid, (Hello, Instant)>,
}

impl Roster {
    pub(super) fn new(own: Seat, program: String) -> Self {
        Self { own, program, heard: BTreeMap::new() }
    }

    /// Takes a member's hello; whether the members that are alive changed.
    pub(super) fn hear(&mut self, hello: Hello, now: Instant) -> bool {
        let member = hello.member;
        if member == self.own.member {
            return false;
        }
        let was = self.is_alive(member, now);
        if hello.is_leaving {
            self.heard.remove(&member);
            return was;
        }
        self.heard.retain(|_, (_, at)| now.duration_since(*at) < ALIVE_WITHIN);
        if self.heard.len() < MEMBERS_MAX || self.heard.contains_key(&member) {
            self.heard.insert(member, (hello, now));
        }
        was != self.is_alive(member, now)
    }

    /// Forgets a member that no longer listens, until it is heard again.
    pub(super) fn lose(&mut self, member: Uuid) -> bool {
        self.heard.remove(&member).is_some()
    }

    fn is_alive(&self, member: Uuid, now: Instant) -> bool {
        self.alive(now).any(|hello| hello.member == member)
    }

    /// The hellos of the other members that are alive and run this program.
    pub(super) fn alive(&self, now: Instant) -> impl Iterator<Item = &Hello> {
        let is_fresh = move |at: &Instant| now.duration_since(*at) < ALIVE_WITHIN;
        let fresh = self.heard.values().filter(move |(_, at)| is_fresh(at)).map(|(hello, _)| hello);
        fresh.filter(|hello| hello.program == self.program)
    }

    /// Number of members that are alive and run another program.
    pub(super) fn n_foreign(&self, now: Instant) -> usize {
        let fresh = self.heard.values().filter(|(_, at)| now.duration_since(*at) < ALIVE_WITHIN);
        fresh.filter(|(hello, _)| hello.program != self.program).count()
    }

    /// The members among whom blocks are placed, this one included.
    pub(super) fn seats(&self, now: Instant) -> Vec<Seat> {
        let others = self.alive(now).map(|hello| Seat { place: hello.place, member: hello.member });
        std::iter::once(self.own).chain(others).collect()
    }

    /// The other members that said they have a block in memory.
    pub(super) fn holding(&self, block: &Block, now: Instant) -> Vec<Uuid> {
        let holds = |hello: &&Hello| {
            let of = hello.versions.iter().filter(|version| {
                (version.catalogue, version.version) == (block.catalogue, block.version)
            });
            of.flat_map(|version| &version.held).any(|held| *held == block.number)
        };
        self.alive(now).filter(holds).map(|hello| hello.member).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::super::words::HeldVersion;
    use super::*;

    fn hello(member: u128) -> Hello {
        Hello {
            member: Uuid::from_u128(member),
            place: Uuid::from_u128(100 + member),
            since_ms: 0,
            program: "same".to_owned(),
            is_leaving: false,
            versions: Vec::new(),
        }
    }

    fn roster() -> Roster {
        let own = Seat { place: Uuid::from_u128(101), member: Uuid::from_u128(1) };
        Roster::new(own, "same".to_owned())
    }

    #[test]
    fn a_member_is_alive_until_its_hellos_stop() {
        let (mut roster, begun) = (roster(), Instant::now());
        assert!(roster.hear(hello(2), begun));
        assert!(!roster.hear(hello(2), begun + ALIVE_WITHIN / 2), "it was alive");
        assert_eq!(roster.seats(begun + ALIVE_WITHIN).len(), 2);
        assert_eq!(roster.seats(begun + 2 * ALIVE_WITHIN).len(), 1, "only this one is left");
        assert!(roster.hear(hello(2), begun + 2 * ALIVE_WITHIN), "it is back");
    }

    #[test]
    fn members_that_leave_or_are_lost_are_gone_at_once() {
        let (mut roster, now) = (roster(), Instant::now());
        roster.hear(hello(2), now);
        roster.hear(hello(3), now);
        assert!(roster.hear(Hello { is_leaving: true, ..hello(2) }, now));
        assert!(roster.lose(Uuid::from_u128(3)) && !roster.lose(Uuid::from_u128(3)));
        assert_eq!(roster.seats(now), [roster.own]);
    }

    #[test]
    fn members_of_another_program_and_oneself_are_left_out() {
        let (mut roster, now) = (roster(), Instant::now());
        assert!(!roster.hear(hello(1), now), "itself");
        assert!(!roster.hear(Hello { program: "other".to_owned(), ..hello(2) }, now));
        assert_eq!((roster.seats(now).len(), roster.n_foreign(now)), (1, 1));
    }

    #[test]
    fn members_say_which_blocks_they_have() {
        let (mut roster, now) = (roster(), Instant::now());
        let version = |version| HeldVersion {
            catalogue: Uuid::nil(),
            version,
            n_blocks: 9,
            is_used: false,
            held: vec![1, 4],
        };
        roster.hear(Hello { versions: vec![version(1)], ..hello(2) }, now);
        roster.hear(Hello { versions: vec![version(2)], ..hello(3) }, now);
        let block = |number| Block { catalogue: Uuid::nil(), version: 1, number };
        assert_eq!(roster.holding(&block(4), now), [Uuid::from_u128(2)]);
        assert_eq!(roster.holding(&block(2), now), Vec::<Uuid>::new());
    }
}
