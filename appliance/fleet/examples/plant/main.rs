//! A plant to try the collector on: answers as many heads would, from one process, without light.
//!
//! ```text
//! cargo run --release -p fringed-fleet --example plant -- --heads 30 --rate 1
//! ```
//!
//! The first line of stdout has the address and when the heads' first histories began, as JSON.

mod heads;

use clap::Parser as _;
use heads::{Options, Plant, serve};
use tokio::net::TcpListener;

#[tokio::main(flavor = "current_thread")]
#[expect(
    clippy::print_stdout,
    reason = "programs that start it read where it listens"
)]
async fn main() -> std::io::Result<()> {
    let options = Options::parse();
    let listener = TcpListener::bind(&options.listen).await?;
    let address = listener.local_addr()?;
    let plant = Plant::new(options);
    let Options {
        seed,
        heads,
        rate,
        gauges,
        ..
    } = plant.options;
    println!(
        r#"{{"listen":"{address}","start_unix_ms":{},"seed":{seed},"heads":{heads},"rate":{rate},"gauges":{gauges}}}"#,
        plant.start_ms
    );
    serve(listener, plant).await
}
