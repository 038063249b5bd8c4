//! Tests of the turns of work: seats, slices, clients and heavy pieces.

use super::*;

fn client(host: u8) -> Option<Client> {
    Some(Client::at([10, 0, 0, host].into()))
}

fn push(turns: &Turns, host: u8, size: Size) -> Stop {
    let pause = Stop::possible();
    let work = Box::new(|| ());
    let piece = Piece { client: client(host), size, pause: pause.clone(), work };
    turns.push(Urgency::Reading, piece);
    pause
}

fn take(turns: &Turns) -> u64 {
    turns.take((Urgency::Reading, 0), Thread::current()).unwrap().id
}

/// As if every piece at work had worked for this long.
fn work_for(turns: &Turns, time: Duration) {
    turns.lock().at_work.iter_mut().for_each(|piece| piece.charged -= time);
}

/// The host whose piece was taken last.
fn newest(turns: &Turns) -> Option<Client> {
    turns.lock().at_work.last().and_then(|piece| piece.client)
}

#[test]
fn the_client_that_has_spent_least_is_next() {
    let turns = Turns::new(1);
    for host in [1, 1, 1, 2, 2] {
        push(&turns, host, Size::Small);
    }
    let mut order = Vec::new();
    // A piece of the first client takes as long as three of the second.
    while turns.lock().waiting[0].front().is_some() {
        let id = take(&turns);
        let host = newest(&turns);
        order.push(if host == client(1) { 1 } else { 2 });
        work_for(&turns, Duration::from_millis(if host == client(1) { 30 } else { 10 }));
        assert!(turns.done(id, None));
    }
    assert_eq!(order, [1, 2, 2, 1, 1]);
    // Idle time earns no credit.
    push(&turns, 3, Size::Small);
    assert_eq!(turns.lock().accounts.len(), 1);
}

#[test]
fn spent_pieces_take_turns_and_give_their_seats_up() {
    let turns = Turns::new(1);
    let greedy: Vec<Stop> = (0..3).map(|_| push(&turns, 1, Size::Small)).collect();
    let other = push(&turns, 2, Size::Small);
    let ids: Vec<u64> = (0..4).map(|_| take(&turns)).collect();
    work_for(&turns, SLICE);
    let mut vacant = Vec::new();
    assert!(turns.next_tick(&mut vacant));
    assert_eq!(vacant.len(), 4);
    // The greedy client has spent three slices, the other one.
    let goes_on = |pause: &Stop| !pause.is_held();
    assert!(goes_on(&other) && !greedy.iter().any(goes_on));
    work_for(&turns, 3 * SLICE);
    assert!(turns.next_tick(&mut vacant));
    let turn: Vec<bool> = greedy.iter().chain([&other]).map(goes_on).collect();
    assert_eq!(turn.iter().filter(|goes_on| **goes_on).count(), 1, "{turn:?}");
    for id in ids {
        assert!(!turns.done(id, None), "its thread has no seat");
    }
    assert!(greedy.iter().all(goes_on), "ended work delays no other");
}

#[test]
fn heavy_pieces_are_no_more_than_threads() {
    let turns = Turns::new(1);
    for size in [Size::Heavy, Size::Heavy, Size::Large] {
        push(&turns, 1, size);
    }
    let sizes = |turns: &Turns| -> Vec<Size> {
        turns.lock().at_work.iter().map(|piece| piece.size).collect()
    };
    let first = take(&turns);
    take(&turns);
    assert_eq!(sizes(&turns), [Size::Heavy, Size::Large]);
    turns.done(first, None);
    take(&turns);
    assert_eq!(sizes(&turns), [Size::Large, Size::Heavy]);
}

#[test]
fn stalled_work_is_detected() {
    let turns = Turns::new(1);
    assert_eq!(turns.stalled(Urgency::Reading), Duration::ZERO);
    push(&turns, 1, Size::Small);
    std::thread::sleep(Duration::from_millis(20));
    assert!(turns.stalled(Urgency::Reading) >= Duration::from_millis(20));
    take(&turns);
    assert_eq!(turns.stalled(Urgency::Reading), Duration::ZERO);
}
