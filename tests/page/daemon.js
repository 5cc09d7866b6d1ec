// The daemon under test: the real program with a small simulated head and its own state folder.
import { spawn } from "node:child_process";
import { existsSync, mkdtempSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { connect } from "node:net";
import { tmpdir } from "node:os";
import { join } from "node:path";

const PATIENCE_MS = 60000;

export const head = (pixels) => `sub_rays = 2
[rig.camera]
width = ${pixels}
height = ${pixels}
`;

const DENT = `[part]
kind = "sheet_metal"
defects = [{ kind = "dent", x = 0.0, y = -8.0, depth_mm = 0.6, diameter_mm = 14.0 }]
`;

export class Place {
  // A head with frames of `pixels` × `pixels`.
  constructor(pixels = 256) {
    this.folder = mkdtempSync(join(tmpdir(), "fringed-page-"));
    this.put("good", head(pixels));
    this.put("dented", head(pixels) + DENT);
  }

  put(name, scenario) {
    writeFileSync(join(this.folder, `${name}-part.toml`), scenario);
    writeFileSync(join(this.folder, `${name}.toml`), `state = "state"\n[head]\nscenario = "${name}-part.toml"\n`);
  }

  remove() {
    // A daemon that was killed leaves its last results in shared memory.
    const serial = join(this.folder, "state", "serial");
    if (existsSync(serial)) rmSync(`/dev/shm/fringed-${readFileSync(serial, "utf8").trim()}`, { force: true });
    rmSync(this.folder, { recursive: true, force: true });
  }
}

export class Daemon {
  // Starts the program and waits until it prints its addresses. `part` is the part in front of the head.
  static async start(program, place, part = "good", http = "127.0.0.1:0") {
    const child = spawn(program, ["serve", "--config", join(place.folder, `${part}.toml`), "--modbus", "127.0.0.1:0", "--http", http], { stdio: ["ignore", "ignore", "pipe"] });
    const daemon = new Daemon();
    daemon.child = child;
    daemon.log = "";
    child.stderr.setEncoding("utf8");
    await new Promise((resolve, reject) => {
      const late = setTimeout(() => reject(new Error(`it does not serve:\n${daemon.log}`)), PATIENCE_MS);
      child.on("exit", (code) => reject(new Error(`it ended with ${code}:\n${daemon.log}`)));
      child.stderr.on("data", (text) => {
        daemon.log += text;
        const secret = /shown this once: (\S+)/.exec(daemon.log);
        if (secret) daemon.secret = secret[1];
        const modbus = /Modbus TCP on ([\d.]+):(\d+)/.exec(daemon.log);
        if (modbus) daemon.modbus = { host: modbus[1], port: Number(modbus[2]) };
        const page = /page on (http:\S+)/.exec(daemon.log);
        if (page) { daemon.url = page[1]; clearTimeout(late); resolve(); }
      });
    });
    return daemon;
  }

  signal(name) { this.child.kill(name); }

  // Writes one register of CONTROL (FC6) as a PLC does; resolves with the answer.
  writeRegister(address, value) {
    return new Promise((resolve, reject) => {
      const plc = connect(this.modbus, () => plc.write(Buffer.from([0, 1, 0, 0, 0, 6, 1, 6, address >> 8, address & 0xff, value >> 8, value & 0xff])));
      plc.on("error", reject);
      plc.on("data", (answer) => { plc.end(); resolve(answer); });
    });
  }

  async end(name = "SIGTERM") {
    if (this.child.exitCode !== null || this.child.signalCode !== null) return;
    const gone = new Promise((resolve) => this.child.once("exit", resolve));
    // A stopped process reacts only to SIGKILL and SIGCONT.
    this.child.kill("SIGCONT");
    this.child.kill(name);
    await gone;
  }
}
