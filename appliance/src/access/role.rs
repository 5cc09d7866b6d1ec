//! Roles: what a user may do. Which role a request needs stands in its row of the router.

use serde::{Deserialize, Serialize};

/// A role; each may do what those before it may.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Role {
    /// Looks and downloads.
    Viewer,
    /// Triggers, resets errors, loads recipes.
    Operator,
    /// Teaches, edits, takes studies, commissions the head.
    Technician,
    /// Imports, deletes, manages users, backs up and restores.
    Engineer,
}

impl Role {
    /// All, the least first.
    pub const ALL: [Self; 4] = [
        Self::Viewer,
        Self::Operator,
        Self::Technician,
        Self::Engineer,
    ];

    /// Its name.
    pub fn word(self) -> &'static str {
        match self {
            Self::Viewer => "viewer",
            Self::Operator => "operator",
            Self::Technician => "technician",
            Self::Engineer => "engineer",
        }
    }

    /// Its name in a sentence: "an operator".
    pub fn with_article(self) -> &'static str {
        match self {
            Self::Viewer => "a viewer",
            Self::Operator => "an operator",
            Self::Technician => "a technician",
            Self::Engineer => "an engineer",
        }
    }

    /// This role and those that may do more, in words: "a technician or an engineer".
    pub fn or_more(self) -> String {
        let more = Self::ALL.into_iter().filter(|role| *role >= self);
        more.map(Self::with_article)
            .collect::<Vec<_>>()
            .join(" or ")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn roles_ascend_and_are_read_as_they_are_written() {
        assert!(Role::ALL.is_sorted());
        for role in Role::ALL {
            let text = serde_json::to_string(&role).unwrap();
            assert_eq!(text, format!("{:?}", role.word()));
            assert_eq!(serde_json::from_str::<Role>(&text).unwrap(), role);
        }
        assert_eq!(Role::Technician.or_more(), "a technician or an engineer");
    }
}
