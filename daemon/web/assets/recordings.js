// Recordings: download, replay and comparison with the live run, identification with other options.

import { bytes, facts, h, table, when } from "./dom.js";
import { identificationView, identifyButton } from "./identify.js";
import { message } from "./message.js";
import { get, listen, post, state } from "./server.js";

const mayReplay = () => ["calibrate", "administer"].includes(state.me.role);
const kPoll_ms = 1000;

function result(replay) {
  if (replay.state === "none") return [];
  const title = h("h2", {}, `Replay of ${replay.name}`);
  if (replay.state === "running") return [title, h("p", {}, "running ...")];
  if (replay.state === "failed") return [title, h("p", { class: "bad" }, replay.error)];
  const r = replay.result;
  const same = r.live_model_ids.length === 0 ? "the recording has no model"
    : r.same_as_live ? "the same model as live" : "another model than live";
  return [title,
    h("p", { class: r.same_as_live || !r.live_model_ids.length ? "good" : "bad" }, same),
    facts("replay", [
      ["snapshots", String(r.snapshots)], ["recorded", `${r.recorded_s.toFixed(1)} s`],
      ["replayed in", `${r.wall_s.toFixed(2)} s`], ["live models", r.live_model_ids.join(", ")],
      ["damage", r.damage], ["losses", r.losses.join("; ")],
      ...r.calibrations.map((c) => ["calibration", Object.entries(c)
        .filter(([, v]) => typeof v !== "object").map(([k, v]) => `${k} ${v}`).join(", ")])])];
}

export async function show(place) {
  const files = h("div"), replay = h("div", { role: "status" }), again = h("div");
  place.append(h("h2", {}, "Recordings"), files, again, replay);
  const identification = identificationView(again);
  let timer = 0;
  const follow = async () => {
    const now = await get("api/replay");
    replay.replaceChildren(...result(now));
    clearTimeout(timer);
    if (now.state === "running") timer = setTimeout(() => follow().catch(() => {}), kPoll_ms);
  };
  const begin = async (name) => {
    try {
      await post("api/replay", { name });
      await follow();
    } catch (error) {
      message(error.message);
    }
  };
  const fill = async () => {
    const recordings = await get("api/recordings");
    files.replaceChildren(table("recordings",
      ["recording", { title: "size", number: true }, "written (UTC)", "state", "replay", "identify"],
      recordings.map((r) => [
        h("a", { href: `recordings/${encodeURIComponent(r.name)}`, download: r.name }, r.name),
        bytes(r.bytes), when(r.modified), r.finished ? "finished" : "being written",
        mayReplay() ? h("button", { type: "button", "aria-label": `Replay ${r.name}`, onclick: () => begin(r.name) }, "Replay") : "",
        mayReplay() ? identifyButton(r.name, null, identification.follow) : ""])));
  };
  await fill();
  await follow();
  await identification.follow();
  if (!mayReplay())
    place.append(h("p", { class: "weak" }, "To replay a recording or identify it again, log in with the role calibrate."));
  const stop = listen("store", () => fill().catch((error) => message(error.message)));
  return () => { stop(); clearTimeout(timer); identification.end(); };
}
