//! The oracle column: why a session names a wrong object, told by what it would take to be right.
//!
//! After some number of touches every examined wrong session is repeated from the truth. If the
//! true object then has more evidence than every other, the search lost it: by *refinement* if
//! a pose near the true one was left and only its place was not exact, else by *retrieval* if the
//! object is on no list of candidates, else by *proposal* (after two touches: not all pairs were
//! compared). Otherwise the true object and its strongest rivals
//! get a *map* of four times as many touches, with the same widths of kernel, and then the *mesh*
//! itself as their map. What still loses is the *likelihood*'s. From the third touch on rivals
//! keep the poses that the search gave them; all poses are refined on the map in question. Finer
//! maps take seconds each: sessions beyond a number stay *open*. A change of map decides anew
//! whatever was close, so that these shares are upper bounds.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use palpate_core::object::ObjectIdx;
use palpate_core::pose::Pose;
use palpate_recogniser::belief::SurfaceBelief;
use palpate_recogniser::model::{SurfaceMap, SurfaceModel};
use palpate_recogniser::options::SurfaceOptions;
use rayon::prelude::*;
use serde::Serialize;

use super::SurfaceScale;
use crate::finer_maps::FinerMaps;
use crate::lost_sessions::{Cause, NEAR, RIVALS};
use crate::object_sessions::Sessions;
use crate::objects::TestObject;
use crate::played::{Played, Step};
use crate::report::{Progress, Report};

/// Numbers of touches after which sessions are examined.
const EXAMINED_AT: [usize; 4] = [2, 3, 4, 6];

/// Sessions to examine, and how their objects were learnt.
pub(super) struct Examined<'a> {
    model: &'a Arc<SurfaceModel>,
    sessions: &'a Sessions<'a>,
    played: &'a Played,
    /// Training readings per object.
    train_readings: usize,
    /// Sessions examined per number of touches, at most.
    sessions_max: usize,
    /// Of these, sessions that are repeated on finer maps.
    finer_max: usize,
}

/// A wrong session, and the evidence (ln) of the true object less that of its strongest rival.
#[derive(Clone, Debug, Serialize)]
struct Lost {
    readings: usize,
    trial: usize,
    /// By the search, on the catalogue's maps.
    found: f64,
    /// Whether the search has left a pose near the true one.
    is_near: bool,
    /// Whether the object is a candidate by its retrieval score; `None` in a small catalogue.
    is_candidate: Option<bool>,
    /// From the true pose.
    search: Option<f64>,
    /// From the true pose on maps of four times as many touches; `None` if not needed.
    map: Option<f64>,
    /// From the true pose on the meshes.
    mesh: Option<f64>,
    #[serde(skip)]
    object: usize,
    #[serde(skip)]
    rivals: Vec<usize>,
}

impl Lost {
    fn cause(&self) -> Cause {
        let wins = |margin: Option<f64>| margin.is_some_and(|margin| margin > 0.0);
        match (wins(self.search), self.is_near, self.map, self.mesh) {
            (true, false, ..) if self.is_candidate == Some(false) => Cause::Retrieval,
            (true, false, ..) => Cause::Proposal,
            (true, true, ..) => Cause::Refinement,
            (false, _, None, None) => Cause::Open,
            (false, _, map, _) if wins(map) => Cause::Map,
            (false, _, _, mesh) if wins(mesh) => Cause::Mesh,
            _ => Cause::Likelihood,
        }
    }
}

/// Examines wrong sessions; adds a row for each and the shares of the causes. `objects` gives the
/// test objects with these indices.
pub(super) fn run(
    examined: &Examined<'_>,
    objects: impl FnOnce(&BTreeSet<usize>) -> anyhow::Result<BTreeMap<usize, TestObject>>,
    report: &mut Report,
    progress: Progress<'_>,
) -> anyhow::Result<()> {
    let mut lost = Vec::new();
    for readings in EXAMINED_AT {
        let wrong: Vec<&Step> =
            examined.played.after(readings).filter(|step| !step.is_right()).collect();
        // Spread over all objects.
        let n = wrong.len().min(examined.sessions_max);
        for step in (0..n).map(|at| wrong[at * wrong.len() / n]) {
            lost.extend(examined.repeated(step)?);
        }
    }
    let tried = finer_sessions(&lost, examined.finer_max);
    let of = |at: &usize| lost[*at].rivals.iter().copied().chain([lost[*at].object]);
    let wanted: BTreeSet<usize> = tried.iter().flat_map(of).collect();
    progress("finer maps", 0, wanted.len());
    let objects = objects(&wanted)?;
    let Examined { model, sessions, train_readings, .. } = examined;
    let finer = |(index, object): (&usize, &TestObject)| {
        let seed = 2 * sessions.seed;
        let finer = FinerMaps::of(object, sessions.sensor, &model.space, *train_readings, seed);
        Some((*index, finer?))
    };
    let finer: BTreeMap<usize, FinerMaps> = objects.par_iter().filter_map(finer).collect();
    for at in tried {
        let lost = &mut lost[at];
        lost.map = examined.margin(lost, |index| Some(&finer.get(&index)?.touched))?;
        lost.mesh = examined.margin(lost, |index| Some(&finer.get(&index)?.mesh))?;
    }
    add_to(report, examined, &lost);
    Ok(())
}

/// The sessions to repeat on finer maps: at most `n` of each number of touches that the search did
/// not lose.
fn finer_sessions(lost: &[Lost], n: usize) -> Vec<usize> {
    let of = |readings| {
        let is_open = move |lost: &Lost| lost.readings == readings && lost.cause() == Cause::Open;
        let open: Vec<usize> = (0..lost.len()).filter(|at| is_open(&lost[*at])).collect();
        let n = n.min(open.len());
        (0..n).map(|at| open[at * open.len() / n]).collect::<Vec<_>>()
    };
    EXAMINED_AT.into_iter().flat_map(of).collect()
}

fn add_to(report: &mut Report, examined: &Examined<'_>, all: &[Lost]) {
    let count = examined.model.maps().len();
    for lost in all {
        let labels = [("examined", "oracle"), ("cause", lost.cause().name())];
        report.labelled(&labels, super::InCatalogue { objects: count, figures: lost });
    }
    for readings in EXAMINED_AT {
        let examined: Vec<&Lost> = all.iter().filter(|lost| lost.readings == readings).collect();
        let n = examined.len() as f64;
        report.summarise(&format!("examined_{count}_at_{readings}"), n);
        if examined.is_empty() {
            continue;
        }
        for cause in Cause::AMONG_OBJECTS {
            let found = examined.iter().filter(|lost| lost.cause() == cause).count() as f64;
            let key = format!("lost_by_{}_{count}_at_{readings}", cause.name());
            report.summarise(&key, found / n);
        }
    }
}

impl<'a> Examined<'a> {
    /// The sessions that the arguments want examined.
    pub(super) fn new(
        config: &SurfaceScale,
        train_readings: usize,
        model: &'a Arc<SurfaceModel>,
        sessions: &'a Sessions<'a>,
        played: &'a Played,
    ) -> Self {
        let (sessions_max, finer_max) = (config.oracle, config.finer);
        Self { model, sessions, played, train_readings, sessions_max, finer_max }
    }

    /// The belief after a step of a session, and the true pose of its object.
    fn replayed(
        &self,
        object: usize,
        trial: usize,
        readings: usize,
    ) -> anyhow::Result<(SurfaceBelief, Pose)> {
        let mut belief = SurfaceBelief::new(self.model.clone(), SurfaceOptions::default(), None)?;
        let mut truth = Pose::IDENTITY;
        for heard in self.sessions.presented(object, trial).iter().take(readings) {
            belief.add(&heard.reading, self.sessions.sensor);
            truth = heard.session_from_object;
        }
        Ok((belief, truth))
    }

    /// A wrong session repeated from the true pose on the catalogue's maps; `None` while neither
    /// pairs nor poses decide.
    fn repeated(&self, step: &Step) -> anyhow::Result<Option<Lost>> {
        let Step { object, trial, readings, .. } = *step;
        let (belief, truth) = self.replayed(object, trial, readings)?;
        let evidence = belief.log_evidence();
        let mut rivals: Vec<usize> = (0..evidence.len()).filter(|at| *at != object).collect();
        rivals.sort_by(|a, b| evidence[*b].total_cmp(&evidence[*a]));
        rivals.truncate(RIVALS);
        let found = evidence[object] - evidence[rivals[0]];
        let is_near = belief.has_pose_near(index(object), &truth, NEAR.0, NEAR.1);
        let is_candidate = belief.is_candidate(index(object));
        let (search, map, mesh) = (None, None, None);
        let lost = Lost {
            readings,
            trial,
            found,
            is_near,
            is_candidate,
            search,
            map,
            mesh,
            object,
            rivals,
        };
        let own = |index: usize| self.model.maps().get(index).map(|map| &**map);
        let search = self.margin(&lost, own)?;
        Ok(search.map(|margin| Lost { search: Some(margin), ..lost }))
    }

    /// The evidence of the true object from its true pose less that of its strongest rival if
    /// these were their maps.
    fn margin<'m>(
        &self,
        lost: &Lost,
        map: impl Fn(usize) -> Option<&'m SurfaceMap>,
    ) -> anyhow::Result<Option<f64>> {
        let (belief, truth) = self.replayed(lost.object, lost.trial, lost.readings)?;
        let on = |object: usize, started: &[Pose]| {
            belief.log_evidence_on(index(object), map(object)?, started)
        };
        let rivals = lost.rivals.iter().map(|rival| on(*rival, &[]));
        let strongest: Option<Vec<f64>> = rivals.collect();
        let strongest = strongest.map(|all| all.into_iter().fold(f64::NEG_INFINITY, f64::max));
        Ok(on(lost.object, &[truth]).zip(strongest).map(|(truth, rival)| truth - rival))
    }
}

fn index(object: usize) -> ObjectIdx {
    ObjectIdx(object as u32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_remedy_that_makes_a_session_right_is_its_cause() {
        let lost = |is_near, [search, map, mesh]: [f64; 3]| Lost {
            readings: 4,
            trial: 0,
            found: -1.0,
            is_near,
            is_candidate: Some(true),
            search: Some(search),
            map: Some(map),
            mesh: Some(mesh),
            object: 0,
            rivals: vec![1],
        };
        assert_eq!(lost(false, [0.1, 1.0, 1.0]).cause(), Cause::Proposal);
        let unlisted = |is_near| Lost { is_candidate: Some(false), ..lost(is_near, [0.1; 3]) };
        assert_eq!(unlisted(false).cause(), Cause::Retrieval);
        assert_eq!(unlisted(true).cause(), Cause::Refinement);
        assert_eq!(lost(true, [0.1, 1.0, 1.0]).cause(), Cause::Refinement);
        assert_eq!(lost(true, [-0.1, 1.0, -1.0]).cause(), Cause::Map);
        assert_eq!(lost(true, [-0.1, -1.0, 1.0]).cause(), Cause::Mesh);
        assert_eq!(lost(true, [-0.1, -1.0, 0.0]).cause(), Cause::Likelihood);
        let open = Lost { map: None, mesh: None, ..lost(true, [-0.1, 0.0, 0.0]) };
        assert_eq!(open.cause(), Cause::Open);
        assert_eq!(finer_sessions(&[open.clone(), open.clone()], 1), [0]);
        assert!(finer_sessions(&[open], 0).is_empty());
    }
}
