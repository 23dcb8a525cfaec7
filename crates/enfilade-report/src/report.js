"use strict";
// Highlights the elements of a cell wherever the page shows it, and hides spaces without a floor to stand on.
(() => {
  const body = document.body;
  const of = (cell) => [
    ...document.querySelectorAll(`[data-cell="${cell}"]`),
    ...[...document.querySelectorAll("[data-ends]")].filter((line) => line.dataset.ends.split(" ").includes(cell)),
  ];
  for (const cell of body.dataset.voids.split(" ").filter(Boolean)) {
    of(cell).forEach((shown) => shown.classList.add("void"));
  }
  let lit = null;
  let kept = null;
  const light = (cell) => {
    if (cell === lit) return;
    document.querySelectorAll(".lit").forEach((shown) => shown.classList.remove("lit"));
    lit = cell;
    if (cell !== null) of(cell).forEach((shown) => shown.classList.add("lit"));
  };
  const cellOf = (target) => {
    const shown = target instanceof Element ? target.closest("[data-cell]") : null;
    return shown === null ? null : shown.dataset.cell;
  };
  document.addEventListener("pointerover", (event) => light(cellOf(event.target) ?? kept));
  document.addEventListener("click", (event) => {
    const cell = cellOf(event.target);
    if (event.target instanceof HTMLInputElement || event.target instanceof HTMLLabelElement) return;
    kept = cell;
    light(cell);
    if (cell === null) return;
    // From a row to the plan, from anywhere else to the row.
    const row = event.target.closest("tr");
    const goal = row === null ? `tr[data-cell="${cell}"]` : `path.cell[data-cell="${cell}"], path.thin[data-cell="${cell}"]`;
    const found = [...document.querySelectorAll(goal)].find((shown) => shown.getClientRects().length > 0);
    found?.scrollIntoView({ behavior: "smooth", block: "center" });
  });
  const voids = document.getElementById("voids");
  voids?.addEventListener("change", () => body.classList.toggle("no-voids", !voids.checked));
})();
