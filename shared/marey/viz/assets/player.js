"use strict";
// The player: reads the motion embedded in the page and plays it on the stage of scene.js.
(() => {
  const { Stage } = MareyScene;
  const { Player, read } = MareyClips;
  const $ = (id) => document.getElementById(id);

  const stage = new Stage($("view"), $("failure"));
  const clips = read(JSON.parse($("motion").textContent));

  // ---------------------------------------------------------------- state
  const state = { clip: 0, seconds: 0, playing: true, speed: 1, follow: true, trail: true, axes: false, theme: "light" };
  const figures = clips.map(() => null);
  const clip = () => clips[state.clip];
  const figure = () => (figures[state.clip] ??= new Player(stage, clip()));

  function home() {
    const { root, height } = clip();
    stage.home(root[0], root[2], height);
  }

  function select(index) {
    const before = figures[state.clip];
    if (before) before.show(false);
    state.clip = Math.min(Math.max(index, 0), clips.length - 1);
    state.seconds = 0;
    figure().show(true);
    figure().paint(stage.theme(state.theme));
    $("caption").textContent = clip().caption || clip().name;
    $("facts").textContent = clip().facts;
    document.title = `${clip().caption || clip().name} · Marey`;
    $("scrub").max = clip().length || 1;
    [...$("clips").children].forEach((b, k) => {
      b.setAttribute("aria-current", String(k === state.clip));
      if (k === state.clip) b.scrollIntoView({ block: "nearest" });
    });
    home();
    drawLanes();
    draw();
  }

  function seek(seconds) {
    state.seconds = Math.min(Math.max(seconds, 0), clip().length);
    draw();
  }

  function play(on) {
    if (on && state.seconds >= clip().length) state.seconds = 0;
    state.playing = on;
    $("play").dataset.playing = String(on);
    $("play").setAttribute("aria-label", on ? "Pause" : "Play");
  }

  function speed(value) {
    state.speed = value;
    $("speed").value = String(value);
  }

  function toggle(option) {
    state[option] = !state[option];
    $(option).setAttribute("aria-pressed", String(state[option]));
    draw();
  }

  function theme(name) {
    state.theme = name;
    figure().paint(stage.theme(name));
    drawLanes();
    draw();
  }

  // ---------------------------------------------------------------- drawing
  function draw() {
    figure().seek(state.seconds, state);
    const { frame, pose } = figure();
    stage.track(pose.joints[0], clip().sole, state.follow);
    $("scrub").value = state.seconds;
    $("clock").textContent = `${state.seconds.toFixed(2)} / ${clip().length.toFixed(2)} s · frame ${frame}`;
    Object.assign(document.body.dataset, { ready: "yes", clip: state.clip, frame });
    stage.render();
  }

  // Foot contact over time: left above right; the fuller the colour, the more of the foot is down.
  function drawLanes() {
    const canvas = $("lanes");
    const width = (canvas.width = Math.max(canvas.clientWidth, 1) * devicePixelRatio);
    const height = (canvas.height = Math.max(canvas.clientHeight, 1) * devicePixelRatio);
    const pen = canvas.getContext("2d");
    const style = getComputedStyle(document.documentElement);
    const { feet, contacts, frames } = clip();
    if (!feet.length) return;
    ["left", "right"].forEach((side, lane) => {
      const [y, tall] = [lane * height * 0.55, height * 0.38];
      pen.globalAlpha = 1;
      pen.fillStyle = style.getPropertyValue("--line");
      pen.fillRect(0, y, width, tall);
      pen.fillStyle = style.getPropertyValue(`--${side}`);
      for (let t = 0; t < frames; t++) {
        const down = contacts[4 * t + 2 * lane] + contacts[4 * t + 2 * lane + 1];
        const [from, to] = [t - 0.5, t + 0.5].map((f) => (Math.min(Math.max(f, 0), frames - 1) / Math.max(frames - 1, 1)) * width);
        pen.globalAlpha = down / 2;
        if (down) pen.fillRect(Math.round(from), y, Math.round(to) - Math.round(from), tall);
      }
    });
  }

  let last = null;
  function tick(now) {
    const passed = last === null ? 0 : Math.min((now - last) / 1000, 0.1);
    last = now;
    if (state.playing && clip().length > 0) {
      state.seconds += passed * state.speed;
      if (state.seconds > clip().length) state.seconds = state.seconds % clip().length;
    }
    stage.controls.update();
    draw();
    requestAnimationFrame(tick);
  }

  function resize() {
    // The list of clips covers the left: look at the middle of what is free.
    stage.resize($("clips").offsetWidth / 2, 10);
    drawLanes();
  }

  // ---------------------------------------------------------------- controls
  if (clips.length > 1) {
    clips.forEach((c, k) => {
      const button = document.createElement("button");
      const text = document.createElement("span");
      text.textContent = c.caption || c.name;
      button.append(text);
      button.title = c.caption;
      button.onclick = () => select(k);
      $("clips").append(button);
    });
  }
  for (const option of ["follow", "trail", "axes"]) $(option).onclick = () => toggle(option);
  $("home").onclick = home;
  $("theme").onclick = () => theme(state.theme === "dark" ? "light" : "dark");
  $("help").onclick = () => {
    $("keys").hidden = !$("keys").hidden;
    $("help").setAttribute("aria-expanded", String(!$("keys").hidden));
  };
  $("play").onclick = () => play(!state.playing);
  $("scrub").oninput = (event) => {
    play(false);
    seek(Number(event.target.value));
  };
  $("speed").onchange = (event) => speed(Number(event.target.value));

  const step = (frames) => {
    play(false);
    seek((Math.round(state.seconds * clip().fps) + frames) / clip().fps);
  };
  const KEYS = {
    " ": () => play(!state.playing),
    ArrowLeft: (event) => step(event.shiftKey ? -10 : -1),
    ArrowRight: (event) => step(event.shiftKey ? 10 : 1),
    ArrowUp: () => select(state.clip - 1),
    ArrowDown: () => select(state.clip + 1),
    Home: () => step(-Infinity),
    End: () => step(Infinity),
    1: () => speed(0.25),
    2: () => speed(0.5),
    3: () => speed(1),
    4: () => speed(2),
    f: () => toggle("follow"),
    t: () => toggle("trail"),
    a: () => toggle("axes"),
    r: home,
    d: () => $("theme").click(),
    "?": () => $("help").click(),
  };
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
    const action = KEYS[event.key.length === 1 ? event.key.toLowerCase() : event.key];
    if (!action) return;
    event.preventDefault();
    action(event);
  });
  addEventListener("resize", resize);

  // What a page around this one, or a test, may call.
  window.marey = {
    select,
    seek,
    play: () => play(true),
    pause: () => play(false),
    state: () => ({ ...state, frame: figure().frame, frames: clip().frames, clips: clips.length }),
    joints: () => figure().pose.joints.map((v) => v.toArray()),
  };

  // #clip=2&t=1.5&paused opens at that moment.
  const hash = new URLSearchParams(location.hash.slice(1));
  state.theme = document.documentElement.dataset.theme;
  resize();
  select(Number(hash.get("clip") ?? 0) || 0);
  theme(state.theme);
  play(!hash.has("paused"));
  if (hash.has("t")) seek(Number(hash.get("t")) || 0);
  requestAnimationFrame(tick);
})();
