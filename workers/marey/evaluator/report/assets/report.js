"use strict";
// The page without its players: theme, and paper, which has no buttons.
(() => {
  const theme = document.getElementById("theme");
  theme.onclick = () => {
    const { dataset } = document.documentElement;
    dataset.theme = dataset.theme === "dark" ? "light" : "dark";
    dispatchEvent(new Event("themechange"));
  };
  for (const link of document.querySelectorAll("nav a")) link.hidden = !document.querySelector(link.hash);
  let opened = [];
  let before = "light";
  addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    for (const details of opened) details.open = true;
    before = document.documentElement.dataset.theme;
    document.documentElement.dataset.theme = "light";
    dispatchEvent(new Event("themechange"));
  });
  addEventListener("afterprint", () => {
    for (const details of opened) details.open = false;
    document.documentElement.dataset.theme = before;
    dispatchEvent(new Event("themechange"));
  });
  document.body.dataset.ready = "yes";
})();
