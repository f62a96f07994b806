"use strict";
// The view of a live stream: its figure, the trail of its root, and the buttons that change the view.
const MareyView = (() => {
  const $ = (id) => document.getElementById(id);
  const { Figure, Stage } = MareyScene;
  const TRAIL = 600; // frames: half a minute

  // A body for an unknown skeleton: all bones alike, and thin.
  function bones({ parents, offsets }) {
    const places = [];
    parents.forEach((parent, j) => places.push(offsets[j].map((x, axis) => x + (parent < 0 ? 0 : places[parent][axis]))));
    const heights = places.map((place) => place[1]);
    const height = Math.max(...heights) - Math.min(...heights) || 1;
    const radius = 0.013 * height;
    const limb = (parent, j) => ({ part: "middle", joints: [parent, j], radii: [radius, radius], offsets: [[0, 0, 0], [0, 0, 0]] });
    const long = (parent, j) => parent >= 0 && Math.hypot(...offsets[j]) > 1e-4;
    return { feet: [], height, sole: radius, limbs: parents.flatMap((parent, j) => (long(parent, j) ? [limb(parent, j)] : [])) };
  }

  class View {
    // bodies: of the skeletons that are known, each with the names of its joints. Shows the first one at rest.
    // Throws without WebGL, after displaying the reason.
    constructor(bodies) {
      this.bodies = bodies;
      this.stage = new Stage($("view"), $("failure"));
      this.figures = new Map();
      this.figure = null;
      this.options = { follow: true, trail: true, axes: false };
      this.trail = this.stage.line(THREE.Line, new Array(3 * TRAIL).fill(0), 0.8);
      this.clearTrail();
      this.themeName = document.documentElement.dataset.theme;
      this.resize(0); // before the camera is put somewhere: how far depends on the window
      this.wear(bodies[0]);
      for (const option of Object.keys(this.options)) $(option).onclick = () => this.toggle(option);
      $("home").onclick = () => this.home();
      $("theme").onclick = () => this.theme(this.themeName === "dark" ? "light" : "dark");
    }

    // Where the root is drawn, metres.
    get root() {
      return this.figure.pose.joints[0];
    }

    get joints() {
      return this.figure.body.parents.length;
    }

    // Show the figure of a skeleton {names, parents, offsets}: in the body of one with the same joints, if there is one.
    wear(skeleton) {
      const { names, parents, offsets } = skeleton;
      const name = JSON.stringify([names, parents, offsets]);
      if (this.worn === name) return;
      this.worn = name;
      if (!this.figures.has(name)) {
        const known = this.bodies.find((body) => body.names.join() === names.join() && body.parents.join() === parents.join());
        this.figures.set(name, new Figure(this.stage, { ...(known ?? bones(skeleton)), parents, offsets }));
      }
      this.figure?.show(false);
      this.figure = this.figures.get(name);
      this.figure.show(true);
      this.figure.pose.rest(offsets[0]);
      this.theme(this.themeName);
      this.home();
    }

    theme(name) {
      this.themeName = name;
      const palette = this.stage.theme(name);
      this.figure.paint(palette);
      this.trail.material.color.set(palette.muted);
    }

    home() {
      this.stage.home(this.root.x, this.root.z, this.figure.body.height);
    }

    toggle(option) {
      this.options[option] = !this.options[option];
      $(option).setAttribute("aria-pressed", String(this.options[option]));
    }

    clearTrail() {
      this.trail.count = 0;
    }

    // A point for each frame gone by, and the last one under the root.
    leaveTrail(passed) {
      const { trail } = this;
      const position = trail.geometry.attributes.position;
      const floor = 0.006 - this.figure.body.sole;
      for (const { root } of passed) {
        if (trail.count === TRAIL - 1) position.array.copyWithin(0, 3);
        else trail.count += 1;
        position.setXYZ(trail.count - 1, root[0], floor, root[2]);
      }
      position.setXYZ(trail.count, this.root.x, floor, this.root.z);
      position.needsUpdate = true;
      trail.geometry.setDrawRange(0, trail.count + 1);
    }

    // now: {frame, later, passed, share} of the buffer; null leaves the figure as it is.
    draw(now) {
      const { figure, stage, options } = this;
      if (now) {
        figure.pose.between(now.frame, now.later, now.share);
        this.leaveTrail(now.passed);
      }
      figure.move(now ? now.frame.contacts : [], options.axes);
      this.trail.visible = options.trail && this.trail.count > 0;
      stage.track(this.root, figure.body.sole, options.follow);
      stage.controls.update();
      stage.render();
    }

    // Fill the window, the figure's middle `down` pixels under the window's.
    resize(down) {
      this.stage.resize(0, down);
    }
  }

  return { View };
})();
