"use strict";
// The live page: starts a stream, shows its frames, steers, pauses and stops it.
(() => {
  const $ = (id) => document.getElementById(id);
  const { Buffer, decode } = MareyFrames;
  const { Link } = MareyLink;
  const clock = () => performance.now() / 1000;
  const shown = document.body.dataset; // state of the page, for tests and embedding pages
  const OPEN = ["starting", "connecting", "reconnecting", "waiting", "live", "paused"];
  const CLIP_SECONDS = 120; // for which the page waits for the clip of a stream that has ended
  const REFUSED = {
    4401: "The API key was not accepted.",
    4403: "The API key may not do this.",
    4404: "There is no such stream.",
  };

  const SUGGESTED = JSON.parse($("suggested").textContent); // prompts that the model followed in measurements
  let view;
  try {
    view = new MareyView.View(JSON.parse($("bodies").textContent));
  } catch (error) {
    shown.state = "failed";
    $("options").disabled = $("prompt").disabled = $("send").disabled = true;
    throw error;
  }

  // ---------------------------------------------------------------- messages
  function say(text, kind = "note") {
    $("message").textContent = text;
    $("message").dataset.kind = kind;
    resize();
  }

  function sentence(text) {
    if (!text) return "";
    const begun = String(text).trim();
    return begun[0].toUpperCase() + begun.slice(1) + (/[.!?]$/.test(begun) ? " " : ". ");
  }

  function enter(state) {
    shown.state = state;
    const open = OPEN.includes(state);
    $("send").textContent = open && state !== "starting" ? "Steer" : "Start";
    $("send").disabled = state === "starting";
    $("pause").textContent = state === "paused" ? "Resume" : "Pause";
    $("pause").disabled = state !== "live" && state !== "paused";
    $("stop").disabled = !open || state === "starting";
    $("options").hidden = open;
    $("ending").hidden = state !== "live" && state !== "paused";
    $("examples").hidden = !SUGGESTED.length || state === "starting";
    $("clip").hidden = open || !$("clip").childElementCount;
    resize();
    tell();
  }

  function tell() {
    const state = document.createElement("b");
    const { position, waits_for: lacks, bundle } = session?.stream ?? {};
    const waits = lacks === "worker" ? `waiting, no worker has loaded ${bundle}` : `waiting, ${position} before it`;
    state.textContent = shown.state === "waiting" && Number.isInteger(position) ? waits : shown.state;
    const facts = [];
    if (session?.buffer.received) {
      const { buffer, latency } = session;
      const open = OPEN.includes(shown.state);
      facts.push(`frame ${shown.frame}`);
      if (open) facts.push(`${buffer.rate(clock()).toFixed(1)} fps`);
      if (open && latency !== null) facts.push(`latency ${latency.toFixed(2)} s`);
      if (open) facts.push(`buffered ${buffer.buffered.toFixed(2)} s`);
      facts.push(`gaps ${buffer.gaps}${buffer.missed ? ` (${buffer.missed} frames)` : ""}`);
    }
    $("facts").replaceChildren(state, document.createTextNode(facts.map((fact) => ` · ${fact}`).join("")));
  }

  // The rewrite of a prompt, if there is one.
  function readAs({ prompt, rewritten, not_rewritten: reason }) {
    if (rewritten && rewritten !== prompt) return ` (read as: ${rewritten})`;
    return reason ? ` (read as it is: ${reason})` : "";
  }

  // What the model does not know of a prompt.
  const warned = ({ warnings = [] }) => warnings.map((warning) => ` – Warning: ${warning}`).join("");

  function listPrompts() {
    const rows = [...session.prompts.values()].sort((a, b) => a.number - b.number);
    const item = (text, from, current) => {
      const [row, when, what] = ["li", "span", "span"].map((tag) => document.createElement(tag));
      Object.assign(when, { className: "from", textContent: from });
      Object.assign(what, { className: current === null ? "text sent" : "text", textContent: text });
      row.append(when, what);
      if (current) row.setAttribute("aria-current", "true");
      return row;
    };
    $("prompts").replaceChildren(
      ...rows.map((row) => item(row.prompt + readAs(row) + warned(row), `from ${row.frame}`, row.number === session.inForce)),
      ...session.pending.map((prompt) => item(prompt, "sent", null)),
    );
    $("prompts").querySelector("[aria-current]")?.scrollIntoView({ block: "nearest" });
  }

  // ---------------------------------------------------------------- the stream
  let session = null; // {stream, buffer, link, prompts: Map by number, pending: [text], inForce, asked, latency}

  const address = (path) => new URL(path, new URL(".", location.href.split(/[?#]/)[0]));
  const wanted = () => new URLSearchParams(location.hash.slice(1)).get("stream");
  const remember = (id) => history.replaceState(null, "", id ? `#stream=${encodeURIComponent(id)}` : location.pathname + location.search);

  function keyed() {
    const key = $("key").value.trim();
    // Characters that a subprotocol may have; all keys consist of them.
    if (/^[\w.~+-]+$/.test(key)) return key;
    say(key ? "This is no API key: it has spaces or signs that no key has." : "An API key is needed: `marey admin keys create` makes one.", "problem");
    $("options").hidden = false;
    $("key").focus();
    return null;
  }

  // The answer of the API; null after a failure, which is displayed.
  async function ask(method, path, key, body) {
    try {
      const headers = { Authorization: `Bearer ${key}`, ...(body && { "Content-Type": "application/json" }) };
      const response = await fetch(address(path), { method, headers, body: body && JSON.stringify(body) });
      if (response.ok) return await response.json();
      await explain(response);
    } catch (error) {
      say("The server does not answer.", "problem");
    }
    return null;
  }

  async function explain(response) {
    const problem = await response.json().catch(() => ({}));
    const what = sentence(problem.detail) + sentence(problem.hint);
    const wait = response.headers.get("Retry-After");
    const told = {
      401: `The API key was not accepted. ${what}`,
      403: `The API key may not do this. ${what}`,
      429: `${what || "Too many streams are open. "}${wait ? `Try again in ${wait} s.` : "Try again later."}`,
    };
    say(told[response.status] ?? (what || `The server answered ${response.status}.`), "problem");
    if (response.status === 401) $("key").focus();
  }

  async function start(prompt) {
    const key = keyed();
    if (key === null) return;
    const body = { prompt };
    for (const field of ["seconds", "seed"]) if ($(field).value !== "") body[field] = Number($(field).value);
    const asked = clock();
    say("");
    $("clip").replaceChildren();
    enter("starting");
    const stream = await ask("POST", "v1/streams", key, body);
    if (stream === null) return enter("idle");
    $("prompt").value = "";
    begin(stream, 0, key);
    session.asked = { at: asked, after: -1 };
  }

  // Watch a stream that was started before, from its recorded frames, which are at most a second behind.
  async function watch(id) {
    const key = keyed();
    if (key === null) return;
    say("");
    enter("starting");
    const stream = await ask("GET", `v1/streams/${encodeURIComponent(id)}`, key);
    if (stream === null) return enter("idle");
    begin(stream, stream.frames ?? 0, key);
  }

  function begin(stream, from, key) {
    session?.link.close();
    const buffer = new Buffer(stream.fps ?? 20, from);
    session = { stream, buffer, prompts: new Map(), pending: [], inForce: null, asked: null, latency: null };
    Object.assign(shown, { frames: "0", frame: "", prompt: "", gaps: "0" });
    view.clearTrail();
    remember(stream.id);
    update(stream);
    enter("connecting");
    const url = () => {
      const socket = address(`v1/streams/${encodeURIComponent(stream.id)}?from=${buffer.next}`);
      socket.protocol = socket.protocol.replace("http", "ws");
      return socket.href;
    };
    session.link = new Link(url, key, { frame, message, open: () => say(""), lost, refused });
  }

  function frame(data) {
    const { buffer, asked, prompts } = session;
    const now = clock();
    const next = decode(data, view.joints);
    if (!buffer.push(next, now)) return;
    if (asked && next.prompt > asked.after) [session.latency, session.asked] = [now - asked.at, null];
    if (!prompts.has(next.prompt)) {
      // Frames may be quicker than the message with the list; that one is right in the end.
      prompts.set(next.prompt, { number: next.prompt, frame: next.number, prompt: session.pending.shift() ?? "…" });
      listPrompts();
    }
    Object.assign(shown, { frames: String(buffer.received), gaps: String(buffer.gaps) });
  }

  function message(told) {
    if (told.type === "stream" || told.type === "end") {
      update(told.stream);
      enter(told.type === "end" && told.stream.state !== "failed" ? "ended" : told.stream.state);
    }
    if (told.type === "gap") session.buffer.gap(told.first, told.count);
    if (told.type === "error") {
      // It does not say which message it is about; an outage of the server (5xx) is about none.
      if (told.problem.status < 500) session.pending.pop();
      listPrompts();
      say(sentence(told.problem.detail) + sentence(told.problem.hint), "problem");
    }
    if (told.type === "end") finish(told.stream);
  }

  function update(stream) {
    Object.assign(session.stream, stream);
    if (stream.skeleton) view.wear(stream.skeleton);
    for (const row of stream.prompts ?? []) {
      const sent = session.prompts.has(row.number) ? -1 : session.pending.indexOf(row.prompt);
      if (sent >= 0) session.pending.splice(0, sent + 1); // they are applied in order
      session.prompts.set(row.number, row);
    }
    listPrompts();
  }

  function finish(stream) {
    remember(null);
    session.buffer.over = true;
    session.pending = [];
    listPrompts();
    const length = `${stream.frames} frames (${(stream.frames / session.buffer.fps).toFixed(1)} s). `;
    const cause = sentence(stream.error?.message ?? stream.reason) + sentence(stream.error?.hint);
    if (stream.state === "failed") say(`Failed after ${length}${cause}`, "problem");
    else say(`Ended after ${length}${cause}${stream.job ? `Its clip is made by job ${stream.job}.` : ""}`);
    if (stream.job) offer(stream.job, session.link.key);
  }

  // ---------------------------------------------------------------- the finished clip
  // Its files are made within seconds of the end, and need the key in a header: a plain link would be refused.
  async function offer(job, key) {
    const current = session;
    const deadline = clock() + CLIP_SECONDS;
    for (let wait = 0.5; clock() < deadline && session === current; wait = Math.min(2 * wait, 5)) {
      const motions = await load(`v1/jobs/${encodeURIComponent(job)}/motions?limit=1`, key, (answer) => answer.json()).catch(() => null);
      const motion = motions?.items[0];
      if (motion && session === current) {
        const buttons = motion.files.map((file) => {
          const button = document.createElement("button");
          Object.assign(button, { type: "button", textContent: `Download ${file.format}` });
          button.dataset.format = file.format;
          button.onclick = () => download(motion.id, file.format, key, button);
          return button;
        });
        $("clip").replaceChildren(...buttons, ...faults(motion.quality));
        return enter(shown.state);
      }
      await new Promise((resolve) => setTimeout(resolve, 1000 * wait));
    }
  }

  // What the quality record of a motion says is wrong with it; nothing if it has none.
  function faults(quality) {
    if (!quality?.flags.length) return [];
    const said = document.createElement("p");
    said.dataset.flags = quality.flags.join(" ");
    said.textContent = `The clip is ${quality.flags.join(", ")}.`;
    return [said];
  }

  async function load(path, key, read) {
    const response = await fetch(address(path), { headers: { Authorization: `Bearer ${key}` } });
    if (!response.ok) throw Object.assign(new Error("refused"), { response });
    return read(response);
  }

  async function download(motion, format, key, button) {
    button.disabled = true;
    try {
      const { blob, name } = await load(`v1/motions/${encodeURIComponent(motion)}/files/${format}?redirect=false`, key, async (response) => ({
        blob: await response.blob(),
        name: filename(response.headers.get("Content-Disposition")) ?? `${motion}.${format}`,
      }));
      const link = document.createElement("a");
      Object.assign(link, { href: URL.createObjectURL(blob), download: name });
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 60_000);
    } catch (error) {
      if (error.response) await explain(error.response);
      else say("The file cannot be loaded: the server does not answer.", "problem");
    }
    button.disabled = false;
  }

  // The name in `attachment; filename="…"; filename*=UTF-8''…`.
  function filename(header) {
    const encoded = header?.match(/filename\*=UTF-8''([^;]+)/i)?.[1];
    return encoded ? decodeURIComponent(encoded) : header?.match(/filename="([^"]+)"/i)?.[1];
  }

  function lost(reason, seconds) {
    enter("reconnecting");
    say(`${sentence(reason || "The connection broke off")}Next try in ${seconds.toFixed(1)} s.`, "problem");
  }

  function refused(code, reason) {
    if (code === 4404) remember(null);
    enter("refused");
    say(`${REFUSED[code] ?? ""} ${sentence(reason)}`, "problem");
    if (code === 4401 || code === 4403) $("key").focus();
  }

  function send(message) {
    const sent = session.link.send(message);
    if (!sent) say("Not sent: the connection is not open. Try again in a moment.", "problem");
    return sent;
  }

  function steer(prompt) {
    if (!send({ kind: "steer", prompt })) return;
    session.asked ??= { at: clock(), after: session.buffer.newest?.prompt ?? 0 };
    session.pending.push(prompt);
    $("prompt").value = "";
    say("");
    listPrompts();
  }

  function pause() {
    if ($("pause").disabled) return;
    send({ kind: shown.state === "paused" ? "resume" : "pause" });
  }

  async function stop() {
    if (session.link.send({ kind: "stop" })) say("Stopping …");
    else if (await ask("DELETE", `v1/streams/${encodeURIComponent(session.stream.id)}`, session.link.key)) say("Stopping, when the connection is back …");
  }

  // The last second passes into the pose of a frame of a stored motion.
  async function endOnPose(motion, frame) {
    const { stream, link } = session;
    const answer = await ask("POST", `v1/streams/${encodeURIComponent(stream.id)}/end`, link.key, { pose: { motion: { id: motion, frame } } });
    if (answer) say("Passing into the pose …");
  }

  // ---------------------------------------------------------------- drawing
  let last = null;
  let told = 0;
  function tick(now) {
    const passed = last === null ? 0 : Math.min((now - last) / 1000, 1);
    last = now;
    draw(passed);
    if (now - told > 200) {
      told = now;
      tell();
    }
    requestAnimationFrame(tick);
  }

  function draw(passed) {
    const now = session?.buffer.advance(passed);
    if (now) {
      shown.frame = now.frame.number;
      if (now.frame.prompt !== session.inForce) {
        shown.prompt = session.inForce = now.frame.prompt;
        listPrompts();
      }
    }
    view.draw(now);
    Object.assign(shown, { ready: "yes", root: view.root.toArray().map((x) => x.toFixed(4)).join() });
  }

  function resize() {
    // The middle of what header and footer leave free; on a wide window the header is beside the figure.
    const above = innerWidth > 760 ? 0 : document.querySelector("header").getBoundingClientRect().bottom;
    view.resize((above - document.querySelector("footer").offsetHeight) / 2);
  }

  // ---------------------------------------------------------------- controls
  $("help").onclick = () => {
    $("keys").hidden = !$("keys").hidden;
    $("help").setAttribute("aria-expanded", String(!$("keys").hidden));
  };
  $("examples").replaceChildren(
    ...SUGGESTED.map((prompt) => {
      const button = document.createElement("button");
      Object.assign(button, { type: "button", textContent: prompt });
      button.onclick = () => {
        $("prompt").value = prompt;
        $("form").requestSubmit();
      };
      return button;
    }),
  );
  $("pause").onclick = pause;
  $("stop").onclick = stop;
  $("form").onsubmit = (event) => {
    event.preventDefault();
    const prompt = $("prompt").value.trim();
    if (shown.state === "starting") return;
    if (OPEN.includes(shown.state)) {
      if (prompt) steer(prompt);
    } else if (prompt) start(prompt);
    else if (wanted()) watch(wanted());
    else $("prompt").focus();
  };
  $("ending").onsubmit = (event) => {
    event.preventDefault();
    endOnPose($("motion").value.trim(), Number($("pose-frame").value));
  };

  const KEYS = {
    " ": pause,
    "/": () => $("prompt").focus(),
    f: () => $("follow").click(),
    t: () => $("trail").click(),
    a: () => $("axes").click(),
    r: () => $("home").click(),
    d: () => $("theme").click(),
    "?": () => $("help").click(),
  };
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    if (event.key === "Escape") $("view").focus();
    // Letters are text in a field, and space is the button's that has the focus.
    if (event.target.closest("input") || (event.key === " " && event.target.closest("button"))) return;
    const action = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action();
  });
  addEventListener("resize", resize);
  addEventListener("hashchange", () => wanted() && watch(wanted()));

  // The key stays in this tab: it is gone when the tab is closed, and never part of an address.
  try {
    $("key").value = sessionStorage.getItem("marey.key") ?? "";
    $("key").oninput = () => sessionStorage.setItem("marey.key", $("key").value.trim());
  } catch {
    // Storage is forbidden: the field alone keeps it.
  }

  enter("idle");
  if (wanted() && $("key").value) watch(wanted());
  else if (wanted()) say("Enter the API key, then press Start, to watch this stream.");
  requestAnimationFrame(tick);
})();
