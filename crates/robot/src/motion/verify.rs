//! Checks certificates: forward kinematics, support heights, bounds of motion, and that the
//! intervals cover the path. Nothing is searched for and nothing is solved.

use super::certificate::Certificate;
use super::certificate_error::CertificateError;
use super::interval::Interval;
use super::placing::Placing;
use super::problem::MotionProblem;
use super::verify_options::VerifyOptions;

/// What a certificate proves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VerifiedMotion {
    /// All pairs keep at least this signed distance less their padding, metres; infinite if there
    /// are no pairs.
    pub clearance_lower_m: f64,
    /// Pairs of convex pieces.
    pub pairs: usize,
    /// Configurations at which they were placed.
    pub configurations: usize,
}

impl Certificate {
    /// Checks everything, the proofs of the bodies included.
    ///
    /// # Errors
    /// The first part that is not usable, record that proves nothing, or pair that is not proven
    /// over all of the path.
    pub fn verify(&self) -> Result<VerifiedMotion, CertificateError> {
        self.verify_with(&VerifyOptions::default())
    }

    /// The same with options.
    ///
    /// # Errors
    /// As [`Certificate::verify`], and [`CertificateError::Stopped`].
    pub fn verify_with(&self, options: &VerifyOptions<'_>) -> Result<VerifiedMotion, CertificateError> {
        // Every pair that counts needs a record.
        let problem = self.claim.problem(options, self.records.len())?;
        self.verify_as(&problem, options)
    }

    /// Checks that the certificate is about this robot among these bodies and obstacles, as they
    /// are, and that it proves the motion free. Takes no time to prove bodies.
    ///
    /// # Errors
    /// What differs, and as [`Certificate::verify`].
    pub fn verify_against(&self, problem: &MotionProblem) -> Result<VerifiedMotion, CertificateError> {
        self.verify_against_with(problem, &VerifyOptions::default())
    }

    /// The same with options.
    ///
    /// # Errors
    /// As [`Certificate::verify_against`], and [`CertificateError::Stopped`].
    pub fn verify_against_with(
        &self,
        problem: &MotionProblem,
        options: &VerifyOptions<'_>,
    ) -> Result<VerifiedMotion, CertificateError> {
        if let Some(what) = self.claim.difference(problem.claim()) {
            return Err(CertificateError::Other(what));
        }
        self.verify_as(problem, options)
    }

    fn verify_as(
        &self,
        problem: &MotionProblem,
        options: &VerifyOptions<'_>,
    ) -> Result<VerifiedMotion, CertificateError> {
        if !self.path.is_usable(&problem.kinematics) {
            let reason = "its configurations are not of this robot, or outside of its limits";
            return Err(CertificateError::Part { part: "path".to_owned(), reason: reason.to_owned() });
        }
        let mut order: Vec<usize> = (0..self.records.len()).collect();
        order.sort_by_key(|&index| self.records[index].interval);
        let (mut placing, mut at, mut configurations) = (Placing::default(), None, 0);
        let mut clearance_lower_m = f64::INFINITY;
        for index in order {
            let record = &self.records[index];
            let pair =
                problem.pairs.get(record.pair as usize).filter(|_| record.interval.is_usable(self.path.segments()));
            let Some(pair) = pair else {
                let reason = "there is no such pair or interval".to_owned();
                return Err(CertificateError::Part { part: format!("records[{index}]"), reason });
            };
            options.check_time()?;
            if at != Some(record.interval) {
                placing.set(problem, &self.path, &record.interval);
                at = Some(record.interval);
                configurations += 1;
            }
            // What is farther apart than another pair changes nothing.
            let is_enough = |lower_m: f64| lower_m > pair.threshold_m && lower_m - pair.padding_m >= clearance_lower_m;
            let lower_m = record.lower_m(problem, &mut placing, is_enough);
            if !(lower_m > pair.threshold_m) {
                return Err(CertificateError::Record { record: index, lower_m, threshold_m: pair.threshold_m });
            }
            clearance_lower_m = clearance_lower_m.min(lower_m - pair.padding_m);
        }
        self.check_cover(problem)?;
        Ok(VerifiedMotion { clearance_lower_m, pairs: problem.pairs.len(), configurations })
    }

    /// Every pair has intervals that cover all segments. The records name pairs that are there.
    fn check_cover(&self, problem: &MotionProblem) -> Result<(), CertificateError> {
        // Intervals pair by pair: where those of each begin is counted first.
        let mut firsts = vec![0; problem.pairs.len() + 1];
        self.records.iter().for_each(|record| firsts[record.pair as usize + 1] += 1);
        (1..firsts.len()).for_each(|index| firsts[index] += firsts[index - 1]);
        let mut intervals = vec![Interval::whole(0); self.records.len()];
        let mut ends = firsts.clone();
        for record in &self.records {
            let end = &mut ends[record.pair as usize];
            intervals[*end] = record.interval;
            *end += 1;
        }
        for (pair, first) in problem.pairs.iter().zip(firsts.windows(2)) {
            let own = &mut intervals[first[0]..first[1]];
            own.sort_unstable_by(|a, b| a.segment.cmp(&b.segment).then_with(|| a.start().total_cmp(&b.start())));
            let mut rest = &own[..];
            for segment in 0..self.path.segments() {
                let count = rest.iter().take_while(|interval| interval.segment as usize == segment).count();
                let (here, after) = rest.split_at(count);
                rest = after;
                if !covers(here) {
                    let [a, b] = problem.items(pair).map(|item| problem.name(item).to_string());
                    return Err(CertificateError::Gap { a, b, segment });
                }
            }
        }
        Ok(())
    }
}

/// Whether intervals, in the order of their starts, cover [0, 1] of their segment.
fn covers(intervals: &[Interval]) -> bool {
    let mut end = 0.0;
    for interval in intervals {
        if interval.start() > end {
            return false;
        }
        end = interval.end().max(end);
    }
    end >= 1.0
}
