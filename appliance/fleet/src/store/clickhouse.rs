//! ClickHouse over its HTTP interface, one server or one of a cluster.
//!
//! What differs between its versions is avoided: no time-to-live, no type JSON; settings that one
//! of them does not know are not set. Of several servers the first that answers is used, until it
//! does not.

use super::{Batch, Complaint, Kind, Received, schema, statements};
use crate::answer::{Gauge, Row};
use crate::http::{Client, HttpError, Url};
use hyper::body::Bytes;
use rustls::ClientConfig;
use serde::Deserialize;
use serde::ser::{Serialize, SerializeMap as _, Serializer};
use std::sync::Arc;
use std::time::Duration;

/// The most bytes of an answer: a line for each of 100,000 heads, or each of their gauges.
const MOST: usize = 512 << 20;
/// Longest wait for an answer: a question about billions of rows takes a while.
const ANSWERING: Duration = Duration::from_secs(60);
/// An insertion into a cluster is done when the rows are where they belong, not when they are
/// spooled on the server that was asked.
const SETTINGS: &str = "&insert_distributed_sync=1&output_format_json_quote_64bit_integers=0";

/// Servers of one store.
pub struct ClickHouse {
    clients: Vec<Client>,
    /// The one that is used.
    at: usize,
    database: String,
}

impl ClickHouse {
    /// The servers of a URL `http://[USER:PASSWORD@]HOST:PORT[,HOST:PORT…]/DATABASE`.
    pub(super) fn of(text: &str, tls: Option<Arc<ClientConfig>>) -> Result<Self, Complaint> {
        let form = "write sqlite:FILE or http://HOST:8123/DATABASE";
        let (scheme, rest) = text.split_once("://").ok_or(form)?;
        let (login, rest) = match rest.rsplit_once('@') {
            Some((login, rest)) => (Some(login.split_once(':').unwrap_or((login, ""))), rest),
            None => (None, rest),
        };
        let (hosts, database) = rest.split_once('/').ok_or(form)?;
        let named = |c: char| c.is_ascii_alphanumeric() || c == '_';
        if database.is_empty() || !database.chars().all(named) {
            return Err("name the database: http://HOST:8123/plant".into());
        }
        let client = |host: &str| {
            let url: Url = format!("{scheme}://{host}").parse()?;
            let mut client = Client::new(url, tls.clone());
            client.patience = ANSWERING;
            if let Some((user, key)) = login {
                let login = [("X-ClickHouse-User", user), ("X-ClickHouse-Key", key)];
                client.headers = login.map(|(name, value)| (name, value.to_owned())).into();
            }
            Ok(client)
        };
        let clients = hosts.split(',').map(client);
        Ok(Self {
            clients: clients.collect::<Result<_, Complaint>>()?,
            at: 0,
            database: database.to_owned(),
        })
    }

    /// Makes database, tables and views where they are missing; those of a cluster must be there.
    pub(super) async fn prepare(&mut self) -> Result<(), Complaint> {
        let create = format!("CREATE DATABASE IF NOT EXISTS {}", self.database);
        self.post("/?".into(), create.into()).await?;
        // What is named `result` in a cluster is there already, and stays.
        for statement in statements(&schema(Kind::ClickHouse)) {
            self.post(self.of_database(), statement.into()).await?;
        }
        // A store of an earlier version has results that this table lacks.
        let known = self
            .lines("SELECT 1 AS known FROM result_at LIMIT 1")
            .await?;
        if known.is_empty() {
            let fill = "INSERT INTO result_at SELECT serial, history, seq, at FROM result";
            self.post(self.of_database(), fill.into()).await?;
        }
        Ok(())
    }

    pub(super) async fn write(&mut self, batch: &Batch) -> Result<(), Complaint> {
        // What is behind a gap must not be known before the gap is.
        self.insert("gap", batch.gaps.iter()).await?;
        self.insert("result", batch.rows.iter().map(Columns))
            .await?;
        self.insert("head", batch.heads.iter()).await
    }

    /// Drops the months that ended before a time, s since 1970 UTC. A server of a cluster has none of
    /// the tables' rows in this database: its months are dropped by hand.
    pub(super) async fn forget(&mut self, before: u64) -> Result<(), Complaint> {
        #[derive(Deserialize)]
        struct Month {
            table: String,
            partition: String,
        }
        let sql = format!(
            "SELECT DISTINCT table, partition FROM system.parts WHERE active AND database = '{}' \
             AND table IN ('result', 'result_at') AND toUInt32OrZero(partition) < toYYYYMM(toDateTime({before}))",
            self.database
        );
        for line in self.lines(&sql).await?.lines() {
            let month = serde_json::from_str(line).map_err(|error| error.to_string())?;
            let Month { table, partition } = month;
            let drop = format!("ALTER TABLE {table} DROP PARTITION {partition}");
            self.post(self.of_database(), drop.into()).await?;
        }
        Ok(())
    }

    /// The answer to a query, a line of JSON per row.
    pub(super) async fn lines(&mut self, sql: &str) -> Result<String, Complaint> {
        let query = format!("{sql}\nFORMAT JSONEachRow");
        let answer = self.post(self.of_database(), query.into()).await?;
        String::from_utf8(answer).map_err(|error| format!("an answer of the store: {error}"))
    }

    async fn insert(
        &mut self,
        table: &str,
        rows: impl Iterator<Item = impl Serialize>,
    ) -> Result<(), Complaint> {
        let mut lines = Vec::new();
        for row in rows {
            serde_json::to_writer(&mut lines, &row).map_err(|error| error.to_string())?;
            lines.push(b'\n');
        }
        if lines.is_empty() {
            return Ok(());
        }
        let path = self.of_database();
        let path = format!("{path}&query=INSERT%20INTO%20{table}%20FORMAT%20JSONEachRow");
        self.post(path, lines.into()).await.map(drop)
    }

    fn of_database(&self) -> String {
        format!("/?database={}{SETTINGS}", self.database)
    }

    /// Asks the server in use, and where it does not answer, each of the others once.
    async fn post(&mut self, path: String, body: Bytes) -> Result<Vec<u8>, Complaint> {
        let mut tried = 0;
        loop {
            let client = &mut self.clients[self.at];
            let error = match client.whole(&path, Some(body.clone()), MOST).await {
                Ok(answer) => return Ok(answer),
                Err(error) => error,
            };
            let words = format!("{}: {error}", client.url());
            tried += 1;
            // A server that refuses what it is asked says so; another would, too.
            let answers = matches!(error, HttpError::Status(..));
            if !answers || tried < self.clients.len() {
                self.at = (self.at + 1) % self.clients.len();
            }
            if tried >= self.clients.len() {
                return Err(words);
            }
        }
    }
}

/// A result as a row of the table.
struct Columns<'a>(&'a Received);

impl Serialize for Columns<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let row: &Row = &self.0.row;
        let mut map = serializer.serialize_map(None)?;
        macro_rules! columns {
            ($($name:ident)*) => {
                $(map.serialize_entry(stringify!($name), &row.$name)?;)*
            };
        }
        macro_rules! nested {
            ($($name:ident)*) => {
                $(map.serialize_entry(concat!("gauges.", stringify!($name)), &Each(&row.gauges, |gauge| &gauge.$name))?;)*
            };
        }
        columns! {
            serial history seq at_unix_ms clock recipe fingerprint part_id press_stroke verdict error_code flags
            exposure_us processing_us coverage
        }
        map.serialize_entry("at", &self.0.at())?;
        map.serialize_entry("received_unix_ms", &self.0.at_unix_ms)?;
        map.serialize_entry(
            "placement",
            row.placement.as_ref().map_or(&[][..], |all| all),
        )?;
        nested! { slot name unit value sigma u low high decision reason }
        map.end()
    }
}

/// One field of each gauge, as a list.
struct Each<'a, T>(&'a [Gauge], fn(&Gauge) -> &T);

impl<T: Serialize> Serialize for Each<'_, T> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(self.1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_url_names_servers_a_login_and_a_database() {
        let store = ClickHouse::of("http://me:p:w@a:1,b:2/plant", None).unwrap();
        let urls: Vec<_> = store
            .clients
            .iter()
            .map(|client| client.url().to_string())
            .collect();
        assert_eq!(urls, ["http://a:1", "http://b:2"]);
        assert_eq!(store.database, "plant");
        for wrong in [
            "http://a:1",
            "http://a:1/",
            "http://a/x;y",
            "postgres://a/x",
            "plant.db",
        ] {
            assert!(ClickHouse::of(wrong, None).is_err(), "{wrong}");
        }
    }

    #[test]
    fn a_row_has_the_columns_of_the_table_and_no_other() {
        let received = Received {
            row: Row {
                gauges: vec![Gauge::default()],
                ..Row::default()
            },
            at_unix_ms: 5_999_999,
        };
        let row = serde_json::to_value(Columns(&received)).unwrap();
        assert_eq!(
            (&row["at"], &row["placement"]),
            (&3600.into(), &serde_json::json!([]))
        );
        let table = schema(Kind::ClickHouse);
        let table = &table[table.find('(').unwrap()..table.find("ENGINE").unwrap()];
        let mut columns: Vec<_> = table
            .lines()
            .filter_map(|line| {
                let (indent, name) = (
                    line.len() - line.trim_start().len(),
                    line.trim().split(' ').next()?,
                );
                let letters = |c: char| c.is_ascii_lowercase() || c == '_';
                let column = !name.is_empty() && name != "gauges" && name.chars().all(letters);
                column.then(|| {
                    if indent > 4 {
                        format!("gauges.{name}")
                    } else {
                        name.to_owned()
                    }
                })
            })
            .collect();
        columns.sort();
        let mut keys: Vec<_> = row.as_object().unwrap().keys().cloned().collect();
        keys.sort();
        assert_eq!(keys, columns);
    }
}
