// The registers as the PLC reads them, refreshed once a second while the view is open.
import { $, cells, fill, make, on } from "./element.js";
import { ask } from "./api.js";
import { notice } from "./session.js";

const rows = new Map();
let timer = 0;
// Fewer values than these are not one for each slot.
const SLOTS = 16;

function matches(register, wanted) {
  return !wanted || register.name.toLowerCase().includes(wanted) || register.block.toLowerCase().includes(wanted) || String(register.address).startsWith(wanted);
}

// The values of a register; those of slots have the number of their slot before them.
function values({ values: all }) {
  return all.map((value, at) => (all.length < SLOTS ? value : `${at + 1}: ${value}`)).join("  ");
}

function build(registers, wanted) {
  rows.clear();
  const lines = [];
  let block = "";
  for (const register of registers.filter((one) => matches(one, wanted))) {
    if (register.block !== block) {
      block = register.block;
      const head = make("th", "block", block.replace(/_/g, " ") + (register.served ? "" : " (not served by this version)"));
      head.colSpan = 5;
      head.scope = "rowgroup";
      lines.push(make("tr", "", head));
    }
    const value = make("td", "value");
    rows.set(register.address, value);
    lines.push(make("tr", register.served ? "" : "quiet", ...cells(String(register.address), make("code", "", register.name), register.type), value, make("td", "quiet", register.meaning)));
  }
  fill($("register-rows"), ...lines);
}

async function refresh(fresh) {
  let registers;
  try { ({ registers } = await ask("GET", "api/registers")); } catch (error) { notice(error.message, true); return; }
  if (fresh || !rows.size) build(registers, $("register-filter").value.trim().toLowerCase());
  for (const register of registers) {
    const cell = rows.get(register.address);
    const words = register.served ? values(register) : "–";
    if (cell && cell.textContent !== words) cell.textContent = words;
  }
}

export function showRegisters(visible) {
  clearInterval(timer);
  if (!visible) return;
  refresh(true);
  timer = setInterval(() => refresh(false), 1000);
}

export function start() {
  on($("register-filter"), "input", () => refresh(true));
}
