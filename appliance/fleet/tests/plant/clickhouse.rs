//! ClickHouse, where its server is installed.

use super::program::*;
use std::fs;
use std::net::TcpListener;
use std::process::{Command, Stdio};
use std::time::Duration;
use tempfile::TempDir;

const CONFIG: &str = "<yandex>
<logger><level>warning</level><log>FOLDER/log</log><errorlog>FOLDER/errors</errorlog></logger>
<http_port>HTTP</http_port><tcp_port>TCP</tcp_port><listen_host>127.0.0.1</listen_host>
<path>FOLDER/data/</path><tmp_path>FOLDER/tmp/</tmp_path><format_schema_path>FOLDER/formats/</format_schema_path>
<users_config>FOLDER/users.xml</users_config><default_profile>default</default_profile><default_database>default</default_database>
<mark_cache_size>67108864</mark_cache_size><timezone>UTC</timezone>
</yandex>";
const USERS: &str = "<yandex><profiles><default><max_memory_usage>1000000000</max_memory_usage></default></profiles>
<users><default><password></password><networks><ip>127.0.0.1</ip></networks><profile>default</profile><quota>default</quota></default></users>
<quotas><default></default></quotas></yandex>";

/// A server with data of its own.
struct Server {
    folder: TempDir,
    http: u16,
    running: Option<Running>,
}

impl Server {
    fn start() -> Option<Self> {
        server("clickhouse-server")?;
        let folder = tempfile::tempdir().unwrap();
        let ports = [(); 2].map(|()| TcpListener::bind("127.0.0.1:0").unwrap());
        let [http, tcp] = ports
            .each_ref()
            .map(|port| port.local_addr().unwrap().port());
        let text = CONFIG.replace("FOLDER", folder.path().to_str().unwrap());
        let text = text
            .replace("HTTP", &http.to_string())
            .replace("TCP", &tcp.to_string());
        fs::write(folder.path().join("config.xml"), text).unwrap();
        fs::write(folder.path().join("users.xml"), USERS).unwrap();
        drop(ports);
        let mut server = Self {
            folder,
            http,
            running: None,
        };
        server.again();
        wait("the server", || server.sql("SELECT 1") == "1");
        Some(server)
    }

    /// Kills it, if it runs, and starts it.
    fn again(&mut self) {
        if let Some(running) = self.running.take() {
            running.kill();
        }
        let program = server("clickhouse-server").unwrap();
        let config = self.folder.path().join("config.xml");
        let mut command = Command::new(program);
        command.arg(format!("--config-file={}", config.display()));
        command.current_dir(self.folder.path());
        let quiet = [(); 2].map(|()| Stdio::null());
        let [out, err] = quiet;
        self.running = Some(Running(command.stdout(out).stderr(err).spawn().unwrap()));
    }

    fn url(&self) -> String {
        format!("http://127.0.0.1:{}/plant", self.http)
    }

    /// The answer to a query; empty without one.
    fn sql(&self, query: &str) -> String {
        let url = format!("http://127.0.0.1:{}/?database=default", self.http);
        let asked = Command::new("curl")
            .args(["-s", "--data-binary", query, &url])
            .output();
        String::from_utf8(asked.unwrap().stdout)
            .unwrap()
            .trim()
            .to_owned()
    }
}

#[test]
fn kills_of_collector_and_server_leave_nothing_out_and_nothing_twice() {
    let Some(mut server) = Server::start() else {
        println!("SKIPPED: there is no clickhouse-server");
        return;
    };
    let plant = Plant::of(50, &["--rate", "4", "--results", "40"]);
    let place = Place::new(&[&plant.heads()], "");
    let mut random = Random(7);
    let parts = ["1/2", "2/2"];
    let mut collectors = parts.map(|part| place.collect(&server.url(), &["--part", part]));
    for kill in 0..3 {
        std::thread::sleep(Duration::from_millis(1500 + random.below(1500)));
        let at = kill % 2;
        let again = place.collect(&server.url(), &["--part", parts[at]]);
        std::mem::replace(&mut collectors[at], again).kill();
        std::thread::sleep(Duration::from_millis(random.below(300)));
        server.again();
    }
    let all =
        "SELECT count(), uniqExact(serial, history, seq), uniqExact(serial) FROM plant.result_once";
    wait("all results", || server.sql(all) == "2000\t2000\t50");
    let twice = "SELECT count() FROM (SELECT serial, seq FROM plant.result_once GROUP BY serial, seq HAVING count() > 1)";
    assert_eq!(server.sql(twice), "0");
    for collector in collectors {
        assert_eq!(collector.terminate(), Some(0));
    }
    let yields = "SELECT sum(results), sum(pass + fail + invalid) FROM plant.yield_hour";
    assert_eq!(server.sql(yields), "2000\t2000");
    let output = ended(&["status", "--store", &server.url()]);
    let table = String::from_utf8(output.stdout).unwrap();
    assert_eq!(table.lines().count(), 51, "{table}");
}
