//! Progress of a long piece of work, for the task that waits for it: slow work reports, so that only
//! a silent task is taken to hang.

/// Gets the share of the work that is done and the present stage in words, from any thread and
/// often; answers whether to go on.
pub type Tell<'a> = dyn Fn(f64, &str) -> bool + Sync + 'a;

/// A stage of a longer piece of work. Copies report to the same listener.
#[derive(Clone, Copy)]
pub struct Headway<'a> {
    tell: &'a Tell<'a>,
    from: f64,
    to: f64,
    words: &'a str,
}

impl<'a> Headway<'a> {
    /// The whole of the work.
    pub fn new(tell: &'a Tell<'a>, words: &'a str) -> Self {
        let (from, to) = (0.0, 1.0);
        Self {
            tell,
            from,
            to,
            words,
        }
    }

    /// Work whose progress is not reported.
    pub fn silent() -> Headway<'static> {
        Headway::new(&|_, _| true, "")
    }

    /// The part of the stage between two shares.
    #[must_use]
    pub fn part(self, from: f64, to: f64) -> Self {
        let at = |share: f64| self.from + share * (self.to - self.from);
        Self {
            from: at(from),
            to: at(to),
            ..self
        }
    }

    /// The same stage with other words.
    #[must_use]
    pub fn called(self, words: &'a str) -> Self {
        Self { words, ..self }
    }

    /// Reports that a share of this stage is done; `false` if the work is to end.
    pub fn tell(self, share: f64) -> bool {
        (self.tell)(self.from + share * (self.to - self.from), self.words)
    }

    /// Reports as [`Self::tell`], where work cannot end early.
    pub fn done(self, share: f64) {
        self.tell(share);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Mutex;

    #[test]
    fn parts_of_parts_tell_shares_of_the_whole() {
        let told = Mutex::new(Vec::new());
        let tell = |share: f64, words: &str| {
            told.lock().unwrap().push((share, words.to_owned()));
            share < 0.7
        };
        let headway = Headway::new(&tell, "work");
        assert!(headway.part(0.0, 0.5).tell(0.5));
        let second = headway.part(0.5, 1.0).called("more");
        assert!(second.part(0.0, 0.5).tell(0.5));
        assert!(!second.tell(1.0), "to be ended");
        let told = told.into_inner().unwrap();
        let expected = [(0.25, "work"), (0.625, "more"), (1.0, "more")];
        assert_eq!(
            told,
            expected.map(|(share, words)| (share, words.to_owned()))
        );
    }
}
