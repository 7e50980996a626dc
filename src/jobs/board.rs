//! What the worker reports of itself, and what it is asked.

use crate::fit;

/// How far the running job is. Everybody reads the latest; nothing queues up for who reads slowly.
#[derive(Clone, Debug, Default)]
pub struct Board {
    running: Option<Running>,
    stopping: bool,
}

#[derive(Clone, Debug)]
struct Running {
    job: u64,
    stop: bool,
    progress: Progress,
    /// What a fit said last: it counts again in each of its parts.
    last: fit::Progress,
}

/// How far a job is, counted from the begin of the attempt.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Progress {
    /// What it is doing.
    pub phase: Phase,
    /// Programs begun; of a search through pairs of links, the pairs begun.
    pub rounds: u64,
    /// Iterations of all of them; of pairs of links, the boxes of joint values looked at.
    pub iterations: u64,
    /// See [`fit::Progress::gap`].
    pub gap: f64,
    /// Points that the program takes into account.
    pub active_points: usize,
}

/// What a job is doing.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Phase {
    /// Before the first program: reading, and of fits the convex hull.
    #[default]
    Preparing,
    /// Looking for points to leave out; fits only.
    Trimming,
    /// Solving programs; fits also refine and cut.
    Solving,
}

impl Board {
    /// How far this job is, if it is the running one.
    pub fn progress(&self, job: u64) -> Option<Progress> {
        self.running.as_ref().filter(|running| running.job == job).map(|running| running.progress)
    }

    /// Whether the server stops.
    pub fn is_stopping(&self) -> bool {
        self.stopping
    }

    pub(super) fn begin(&mut self, job: u64) {
        let (progress, last) = (Progress::default(), fit::Progress::default());
        self.running = Some(Running { job, stop: false, progress, last });
    }

    pub(super) fn end(&mut self) {
        self.running = None;
    }

    pub(super) fn stop(&mut self, job: u64) {
        if let Some(running) = self.running.as_mut().filter(|running| running.job == job) {
            running.stop = true;
        }
    }

    pub(super) fn stop_all(&mut self) {
        self.stopping = true;
    }

    /// Notes an iteration of a job. Tells whether to go on: not when it was stopped, nor when it is
    /// not the running one any more.
    pub(super) fn note(&mut self, job: u64, phase: Phase, said: fit::Progress) -> bool {
        let Some(running) = self.running.as_mut().filter(|running| running.job == job) else { return false };
        let Running { progress, last, .. } = running;
        // A part of the fit that begins counts its own rounds and iterations from 1 on.
        let is_new_round = said.round != last.round || said.iterations <= last.iterations;
        progress.rounds += u64::from(is_new_round);
        progress.iterations += 1;
        (progress.phase, progress.gap, progress.active_points) = (phase, said.gap, said.active_points);
        *last = said;
        !(running.stop || self.stopping)
    }

    /// Notes how far a search through pairs of links is: pairs begun, and boxes of joint values
    /// looked at in all of them. Tells whether to go on, as [`Board::note`] does.
    pub(super) fn note_boxes(&mut self, job: u64, pairs: u64, boxes: u64) -> bool {
        let Some(running) = self.running.as_mut().filter(|running| running.job == job) else { return false };
        let phase = Phase::Solving;
        running.progress = Progress { phase, rounds: pairs, iterations: boxes, ..Progress::default() };
        !(running.stop || self.stopping)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn counts_go_on_where_a_part_of_the_fit_begins() {
        let mut board = Board::default();
        assert!(!board.note(7, Phase::Solving, fit::Progress::default()), "nothing is running");
        board.begin(7);
        let said = |round, iterations| fit::Progress { round, iterations, ..fit::Progress::default() };
        // Two programs of a trim, one of two iterations and one of one; then a fit of one program;
        // then one of two.
        let heard = [(1, 1), (1, 2), (2, 3), (1, 1), (1, 1), (2, 2)];
        let counts = heard.map(|(round, iterations)| {
            assert!(board.note(7, Phase::Solving, said(round, iterations)));
            let progress = board.progress(7).expect("it is running");
            (progress.rounds, progress.iterations)
        });
        assert_eq!(counts, [(1, 1), (1, 2), (2, 3), (3, 4), (4, 5), (5, 6)]);
        assert_eq!(board.progress(8), None);
    }

    #[test]
    fn a_stop_is_for_the_running_job_only() {
        let said = fit::Progress { round: 1, iterations: 1, ..fit::Progress::default() };
        let mut board = Board::default();
        board.begin(1);
        board.stop(2);
        assert!(board.note(1, Phase::Solving, said));
        board.stop(1);
        assert!(!board.note(1, Phase::Solving, said));
        board.begin(2);
        assert!(!board.note(1, Phase::Solving, said), "it is not the running one any more");
        assert!(board.note(2, Phase::Solving, said));
        assert!(board.note_boxes(2, 3, 70) && !board.note_boxes(1, 3, 70));
        board.stop_all();
        assert!(!board.note(2, Phase::Solving, said) && !board.note_boxes(2, 3, 70));
    }
}
