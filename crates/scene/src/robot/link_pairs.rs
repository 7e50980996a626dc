//! Pairs of links that may touch.

/// Which pairs of links of one robot may touch: a symmetric table.
#[derive(Clone, Debug)]
pub(crate) struct LinkPairs {
    links: usize,
    allowed: Vec<bool>,
}

impl LinkPairs {
    /// None, of so many links.
    pub(crate) fn none(links: usize) -> Self {
        Self { links, allowed: vec![false; links * links] }
    }

    pub(crate) fn allow(&mut self, a: usize, b: usize) {
        self.allowed[a * self.links + b] = true;
        self.allowed[b * self.links + a] = true;
    }

    pub(crate) fn is_allowed(&self, a: usize, b: usize) -> bool {
        self.allowed[a * self.links + b]
    }
}
