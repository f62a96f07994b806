"use strict";
// The cards of a gallery, one a motion, and the commands that say what was thought of them. small_players.js, which comes
// after this, plays what is in them.
(() => {
  const { title, count, columns, earlier, later, cards } = JSON.parse(document.getElementById("cards").textContent);
  const WISHES = ["keep", "reject", "reroll"];
  const wished = new Map(); // id of a motion -> one of WISHES

  function element(tag, attributes, ...children) {
    const made = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) made.setAttribute(name, value);
    made.append(...children);
    return made;
  }

  function player(index, caption) {
    const canvas = element("canvas", { role: "img", width: 340, height: 255, "aria-label": `3D view of “${caption}”: drag to turn` });
    const tools = element(
      "div",
      { class: "tools" },
      element("button", { class: "play", type: "button", "aria-label": "Play" }),
      element("input", { class: "scrub", type: "range", min: 0, max: 1, value: 0, step: "any", "aria-label": "Time" }),
      element("output", { class: "clock" }),
      element("button", { class: "larger", type: "button", "aria-pressed": "false" }, "larger"),
    );
    return element("div", { class: "player", "data-clip": index }, canvas, tools);
  }

  function wishes(card, figure) {
    const buttons = WISHES.map((wish) => element("button", { type: "button", "aria-pressed": "false", "data-wish": wish }, wish === "reroll" ? "re-roll" : wish));
    const show = () => {
      figure.dataset.wish = wished.get(card.id) ?? "";
      for (const button of buttons) button.setAttribute("aria-pressed", String(button.dataset.wish === wished.get(card.id)));
    };
    for (const button of buttons) {
      button.onclick = () => {
        const again = wished.get(card.id) === button.dataset.wish;
        if (again) wished.delete(card.id);
        else wished.set(card.id, button.dataset.wish);
        show();
        tell();
      };
    }
    return element("div", { class: "wishes" }, ...buttons);
  }

  function tell() {
    const lines = WISHES.map((wish) => [wish, [...wished].filter(([, each]) => each === wish).map(([id]) => id)]);
    const commands = lines.filter(([, ids]) => ids.length).map(([wish, ids]) => `marey motions ${wish} ${ids.join(" ")}`);
    document.getElementById("commands").value = commands.join("\n");
    document.getElementById("wishes").hidden = !commands.length;
  }

  function edited({ source, prompt, operations }) {
    const about = prompt ? `“${prompt}”` : source;
    const there = cards.findIndex((card) => card.id === source);
    const name = there < 0 ? element("span", { title: source }, about) : element("a", { href: `#motion-${there}`, title: source }, about);
    return element("p", { class: "edited" }, "edited from ", name, operations && `: ${operations}`);
  }

  function draw(card, index) {
    const caption = element("figcaption", {}, element("p", { class: "prompt" }, card.prompt || "(prompt erased)"));
    caption.append(element("p", { class: "remark" }, card.facts));
    if (card.edit) caption.append(edited(card.edit));
    if (card.tags.length) caption.append(element("div", { class: "tags" }, ...card.tags.map((tag) => element("span", {}, tag))));
    if (card.flags.length) caption.append(element("div", { class: "tags flags" }, ...card.flags.map((flag) => element("span", {}, flag))));
    if (card.said) caption.append(element("p", { class: "said" }, card.said));
    caption.append(element("p", { class: "id" }, card.id));
    const figure = element("figure", { class: "clip", id: `motion-${index}` }, player(index, card.prompt), caption);
    caption.append(wishes(card, figure));
    return figure;
  }

  document.getElementById("title").textContent = title;
  document.getElementById("count").textContent = count;
  for (const [name, href] of Object.entries({ earlier, later })) {
    if (href) Object.assign(document.getElementById(name), { href, hidden: false });
  }
  const clips = document.getElementById("clips");
  clips.append(...cards.map(draw));
  if (columns > 1) {
    clips.style.gridTemplateColumns = `repeat(${columns}, minmax(0, 1fr))`;
    let row = []; // the motions that belong together: of one prompt, and edits of them
    cards.forEach((card, index) => {
      const joins = row.some((each) => each.prompt === card.prompt || each.id === card.edit?.source);
      row = joins ? [...row, card] : [card];
      if (!joins) clips.children[index].style.gridColumnStart = 1;
    });
  }
  document.getElementById("commands").onfocus = (event) => event.target.select();
  document.getElementById("theme").onclick = () => {
    const { dataset } = document.documentElement;
    dataset.theme = dataset.theme === "dark" ? "light" : "dark";
    dispatchEvent(new Event("themechange"));
  };
  document.body.dataset.ready = "yes";
})();
