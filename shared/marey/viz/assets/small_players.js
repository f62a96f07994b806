"use strict";
// The small players. All stages share one renderer, so the page needs one WebGL context however many clips it shows; each
// picture is copied onto the player's own canvas. A clip plays while it is in view, unless the browser asks for less motion.
(() => {
  const { Stage } = MareyScene;
  const { Player, read } = MareyClips;
  const OPTIONS = { axes: false, trail: true };
  const still = matchMedia("(prefers-reduced-motion: reduce)").matches;
  const clips = read(JSON.parse(document.getElementById("motion").textContent));
  const boxes = [...document.querySelectorAll(".player")];
  let renderer;
  try {
    renderer = Stage.renderer(document.createElement("canvas"), document.getElementById("failure"));
  } catch {
    for (const box of boxes) box.hidden = true;
    return; // the page displays the reason, and its text is complete
  }
  const size = { width: 0, height: 0 }; // of the renderer: the largest picture so far

  class SmallPlayer {
    constructor(box) {
      this.box = box;
      this.clip = clips[Number(box.dataset.clip)];
      this.canvas = box.querySelector("canvas");
      this.pen = this.canvas.getContext("2d");
      [this.button, this.scrub, this.clock, this.larger] = ["play", "scrub", "clock", "larger"].map((name) => box.querySelector(`.${name}`));
      this.scrub.max = this.clip.length || 1;
      this.seconds = 0;
      this.playing = !still;
      this.seen = false;
      this.changed = true;
      this.button.onclick = () => this.play(!this.playing);
      this.scrub.oninput = () => {
        this.play(false);
        this.seek(Number(this.scrub.value));
      };
      this.larger.onclick = () => {
        const large = box.closest(".clip").classList.toggle("large");
        this.larger.setAttribute("aria-pressed", String(large));
        this.larger.textContent = large ? "smaller" : "larger";
      };
      this.play(this.playing);
    }

    // A stage costs memory on the graphics card, so it is set only for a clip in view.
    open() {
      this.stage = new Stage(this.canvas, null, renderer);
      this.stage.sun.shadow.mapSize.set(1024, 1024);
      const { controls } = this.stage;
      // The wheel and a finger's way up or down scroll the page.
      Object.assign(controls, { enableZoom: false, enablePan: false });
      this.canvas.style.touchAction = "pan-y";
      controls.addEventListener("change", () => (this.changed = true));
      this.figure = new Player(this.stage, this.clip);
      this.paint();
      this.resize();
      const { root, height } = this.clip;
      this.stage.home(root[0], root[2], height);
    }

    paint() {
      if (!this.stage) return;
      this.figure.paint(this.stage.theme(document.documentElement.dataset.theme));
      this.changed = true;
    }

    resize() {
      if (!this.stage || !this.canvas.clientWidth) return;
      const ratio = renderer.getPixelRatio();
      const [width, height] = [this.canvas.clientWidth, this.canvas.clientHeight];
      if (this.canvas.width !== Math.floor(width * ratio) || this.canvas.height !== Math.floor(height * ratio)) {
        [this.canvas.width, this.canvas.height] = [Math.floor(width * ratio), Math.floor(height * ratio)];
      }
      [this.width, this.height] = [width, height];
      this.stage.aim(width, height, 0, 0);
      this.changed = true;
    }

    play(on) {
      if (on && this.seconds >= this.clip.length) this.seconds = 0;
      this.playing = on;
      this.button.dataset.playing = String(on);
      this.button.setAttribute("aria-label", on ? "Pause" : "Play");
      this.changed = true;
    }

    seek(seconds) {
      this.seconds = Math.min(Math.max(seconds, 0), this.clip.length);
      this.changed = true;
    }

    advance(passed) {
      if (!this.playing || !(this.clip.length > 0)) return;
      this.seek((this.seconds + passed) % this.clip.length);
    }

    draw() {
      if (!this.stage) this.open();
      const { stage, figure, pen, canvas } = this;
      stage.controls.update();
      if (!this.changed || !this.width) return;
      this.changed = false;
      figure.seek(this.seconds, OPTIONS);
      stage.track(figure.pose.joints[0], this.clip.sole, true);
      if (this.width > size.width || this.height > size.height) {
        [size.width, size.height] = [Math.max(this.width, size.width), Math.max(this.height, size.height)];
        renderer.setSize(size.width, size.height, false);
      }
      renderer.setViewport(0, 0, this.width, this.height);
      stage.render();
      // The viewport stands at the bottom left.
      pen.drawImage(renderer.domElement, 0, renderer.domElement.height - canvas.height, canvas.width, canvas.height, 0, 0, canvas.width, canvas.height);
      this.scrub.value = this.seconds;
      this.clock.textContent = `${this.seconds.toFixed(1)} / ${this.clip.length.toFixed(1)} s`;
      this.box.dataset.frame = figure.frame;
    }
  }

  const players = boxes.map((box) => new SmallPlayer(box));
  const of = new Map(players.map((player) => [player.box, player]));
  const eyes = new IntersectionObserver((entries) => {
    for (const { target, isIntersecting } of entries) of.get(target).seen = isIntersecting;
  });
  const sizes = new ResizeObserver((entries) => {
    for (const { target } of entries) of.get(target.closest(".player")).resize();
  });
  for (const player of players) {
    eyes.observe(player.box);
    sizes.observe(player.canvas);
  }
  addEventListener("themechange", () => {
    for (const player of players) player.paint();
  });
  // Paper shows all of them.
  addEventListener("beforeprint", () => {
    for (const player of players) player.draw();
  });

  let last = null;
  function tick(now) {
    const passed = last === null ? 0 : Math.min((now - last) / 1000, 0.1);
    last = now;
    for (const player of players) {
      if (!player.seen) continue;
      player.advance(passed);
      player.draw();
    }
    requestAnimationFrame(tick);
  }
  requestAnimationFrame(tick);

  // What a test may call.
  window.marey = {
    seek: (index, seconds) => {
      players[index].play(false);
      players[index].seek(seconds);
      players[index].draw();
    },
    joints: (index) => players[index].figure.pose.joints.map((v) => v.toArray()),
  };
})();
