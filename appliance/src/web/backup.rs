//! Backups: one is made and sent while the station runs, one that comes is checked, and what is to come
//! back is ordered for the next start.

use super::downloads::{attachment, sent_alone};
use super::gate::Changed;
use super::orders::{Accepted, accepted};
use super::problem::{Answered, Problem};
use super::request::{self, Query};
use super::site::{Site, alone};
use crate::access::Signed;
use crate::backup::exchange::{OrderError, RestoreChoice};
use crate::backup::making::{BackedUpDevice, BackupContents};
use crate::backup::plan::Present;
use crate::system::computing;
use axum::Extension;
use axum::extract::Request;
use axum::response::{IntoResponse, Json, Response};
use serde_json::Value;
use std::io::{self, ErrorKind};
use std::time::Duration;
use tokio::sync::OwnedMutexGuard;

impl From<OrderError> for Problem {
    fn from(error: OrderError) -> Self {
        match &error {
            OrderError::Nothing(_) => Self::busy(error),
            OrderError::Refused(_) => Self::unfit(error),
            OrderError::Store(source) => Self::unstored(&error, source),
        }
    }
}

/// Longest wait for the end of a backup that another client has received already.
const TURN: Duration = Duration::from_secs(10);

/// One backup is made or checked at a time.
async fn one(site: &Site) -> Answered<OwnedMutexGuard<()>> {
    let busy = "another backup is being made or checked: wait until that is done";
    let turn = tokio::time::timeout(TURN, site.carrying.clone().lock_owned()).await;
    turn.map_err(|_| Problem::busy(busy))
}

/// Makes a backup and sends it piece by piece.
pub(super) async fn make(site: Site, Query(wanted): Query<BackupContents>) -> Answered<Response> {
    let turn = one(&site).await?;
    let serial = site.station.snapshot().identity.serial.clone();
    let headers = attachment("application/zip", &format!("fringed-{serial}-backup.zip"));
    let failed = "making the backup failed; see the log";
    let body = sent_alone("backing up", failed, move |mut to, begun| {
        let _turn = turn;
        // The measuring task needs the cores.
        computing::give_way();
        let device = BackedUpDevice {
            serial,
            configuration: site.configuration.clone(),
        };
        match site.backups.snapshot(&device, wanted, site.access.record()) {
            Err(words) => drop(begun.send(Err(Problem::broken(words)))),
            Ok(snapshot) => {
                if begun.send(Ok(())).is_ok() {
                    // The locks are free again: from here on only idle cores work.
                    computing::stand_back();
                    let written = snapshot.write(&mut to).map_err(io::Error::other);
                    to.end(written);
                }
            }
        }
    });
    Ok((headers, body.await?).into_response())
}

pub(super) async fn state(site: Site) -> Answered<Json<Value>> {
    site.aside(|site| Ok(shown(site))).await.map(Json)
}

fn shown(site: &Site) -> Value {
    let mut shown = site.backups.shown();
    shown["restarts"] = site.restart.is_some().into();
    shown
}

/// Receives a backup, checks it, and answers with what it would bring back.
pub(super) async fn check(site: Site, request: Request) -> Answered<Json<Value>> {
    let turn = one(&site).await?;
    if !shown(&site)["ordered"].is_null() {
        let words = "a restore is ordered: discard it first, or start the device again";
        return Err(Problem::busy(words));
    }
    let folder = site.backups.folder();
    let made = std::fs::create_dir_all(&folder);
    made.map_err(|error| {
        Problem::unstored(format!("store the file: {error}: free space"), &error)
    })?;
    let upload = request::file(&site, request, folder, request::BACKUP).await?;
    let failed = "checking the backup failed; see the log";
    let checking = site.clone();
    let checked = alone("checking a backup", failed, move || {
        computing::give_way();
        let _turn = turn;
        checked(&checking, upload.file.path())
    });
    checked.await??;
    Ok(Json(shown(&site)))
}

fn checked(site: &Site, archive: &std::path::Path) -> Answered<()> {
    let refused = |error: io::Error| {
        let words = format!("restore: {error}");
        match error.kind() {
            ErrorKind::StorageFull | ErrorKind::QuotaExceeded => Problem::unstored(words, &error),
            _ => Problem::unfit(words),
        }
    };
    let checked = site.backups.check(archive).map_err(refused)?;
    let snapshot = site.station.snapshot();
    let calibration = site.calibration.get();
    let present = Present {
        serial: &snapshot.identity.serial,
        configuration: &site.configuration,
        recipes: &site.recipes,
        history: &site.history,
        users: &site.access.users(),
        calibration: calibration.as_deref(),
        head: site.commission.head().map(|head| head.calibration.sizes()),
        calibrated_elsewhere: site.calibration_file.is_some(),
    };
    let plan = site.backups.plan(&checked, &present);
    let offered = site.backups.offer(&checked, plan);
    offered
        .map_err(|error| Problem::unstored(format!("store the plan: {error}: free space"), &error))
}

/// Does something with what was checked or ordered, and answers with what is then.
async fn ordered(
    site: Site,
    words: String,
    act: impl FnOnce(&Site) -> Answered<()> + Send + 'static,
) -> Answered<(Extension<Changed>, Json<Value>)> {
    let turn = one(&site).await?;
    let after = site.change(move |site| {
        let _turn = turn;
        act(site)?;
        Ok(shown(site))
    });
    Ok((Extension(words.into()), Json(after.await?)))
}

pub(super) async fn order(
    site: Site,
    Extension(signed): Extension<Signed>,
    request: Request,
) -> Answered<(Extension<Changed>, Json<Value>)> {
    let choice: RestoreChoice = request::json(request).await?;
    let mut words = choice.what.word().to_owned();
    for (chosen, more) in [
        (choice.users, ", with its users"),
        (choice.replaces_device, ", in place of its device"),
    ] {
        words += if chosen { more } else { "" };
    }
    ordered(site, words, move |site| {
        let serial = &site.station.snapshot().identity.serial;
        Ok(site.backups.order(&choice, serial, &signed.to_string())?)
    })
    .await
}

pub(super) async fn discard(site: Site) -> Answered<(Extension<Changed>, Json<Value>)> {
    ordered(site, String::new(), |site| {
        let forgotten = site.backups.forget();
        forgotten.map_err(|error| Problem::unstored(format!("discard: {error}"), &error))
    })
    .await
}

pub(super) async fn undo(
    site: Site,
    Extension(signed): Extension<Signed>,
) -> Answered<(Extension<Changed>, Json<Value>)> {
    ordered(site, String::new(), move |site| {
        Ok(site.backups.order_undo(&signed.to_string())?)
    })
    .await
}

/// Time for the answer to reach the client before the program ends.
const ANSWERED: Duration = Duration::from_millis(300);

/// Ends the program, which its service manager starts anew.
pub(super) async fn restart(site: Site) -> Answered<Accepted> {
    if site.restart.is_none() {
        let words = "restart: no service manager started fringed: end it and start it again";
        return Err(Problem::busy(words));
    }
    tokio::spawn(async move {
        tokio::time::sleep(ANSWERED).await;
        if let Some(restart) = &site.restart {
            restart();
        }
    });
    Ok(accepted())
}
