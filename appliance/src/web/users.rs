//! Users: list, set, remove.

use super::gate::Changed;
use super::problem::Answered;
use super::request::{self, Path};
use super::site::Site;
use crate::access::users::MOST_USERS;
use crate::access::{ENGINEER, Role, Signed, User};
use crate::system::clock;
use axum::Extension;
use axum::extract::Request;
use axum::response::Json;
use serde::Deserialize;
use serde_json::{Value, json};

/// What a user is to be.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct WantedUser {
    role: Role,
    /// Password or PIN; it stays where it is left out.
    secret: Option<String>,
}

pub(super) async fn list(site: Site) -> Json<Value> {
    let mut rows = vec![json!({
        "name": ENGINEER, "role": Role::Engineer, "fixed": true, "pin": false,
        "since_utc_us": null, "by": null,
    })];
    rows.extend(site.access.users().iter().map(row));
    Json(json!({ "most": MOST_USERS, "users": rows }))
}

fn row(user: &User) -> Value {
    let mut row = json!(user);
    row["fixed"] = false.into();
    row
}

pub(super) async fn set(
    site: Site,
    Path(name): Path<String>,
    Extension(signed): Extension<Signed>,
    request: Request,
) -> Answered<(Extension<Changed>, Json<Value>)> {
    let WantedUser { role, secret } = request::json(request).await?;
    let set = site.change(move |site| {
        let since = (clock::utc_us(), &*signed.name);
        Ok(site
            .access
            .set_user(&name, role, secret.as_deref(), since)?)
    });
    let user = set.await?;
    let changed = format!("{} is {}", user.name, user.role.with_article());
    Ok((Extension(changed.into()), Json(row(&user))))
}

pub(super) async fn remove(site: Site, Path(name): Path<String>) -> Answered<Json<Value>> {
    let removed = name.clone();
    site.change(move |site| Ok(site.access.remove_user(&removed)?))
        .await?;
    Ok(Json(json!({ "name": name })))
}
