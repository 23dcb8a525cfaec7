"use strict";
// Highlights the elements of a cell wherever the page shows it, tells why it is there, and hides spaces without a floor to stand on.
(() => {
  const body = document.body;
  const of = (thing) => [
    ...document.querySelectorAll(`[data-cell="${thing}"]`),
    ...[...document.querySelectorAll("[data-ends]")].filter(
      ({ dataset }) => dataset.ends === thing || dataset.ends.split(" ").includes(thing),
    ),
  ];
  for (const cell of body.dataset.voids.split(" ").filter(Boolean)) {
    of(cell).forEach((shown) => shown.classList.add("void"));
  }
  let lit = null;
  let kept = null;
  // What it is pointed at: a cell's number, or the two of a doorway.
  const light = (thing) => {
    if (thing === lit) return;
    document.querySelectorAll(".lit").forEach((shown) => shown.classList.remove("lit"));
    lit = thing;
    tell(thing);
    if (thing !== null) of(thing).forEach((shown) => shown.classList.add("lit"));
  };
  const why = document.getElementById("why");
  const rows = [...document.querySelectorAll("#reasons tr")];
  const tell = (thing) => {
    if (why === null) return;
    const ends = thing?.split(" ") ?? [];
    const isAbout = (row) =>
      ends.length === 2
        ? ends.every((cell) => row.dataset.ends?.split(" ").includes(cell))
        : row.dataset.cell === thing || row.dataset.ends?.split(" ").includes(thing);
    const found = thing === null ? [] : rows.filter(isAbout);
    // What is about the cell itself before its doorways.
    found.sort((a, b) => (a.dataset.cell === undefined) - (b.dataset.cell === undefined));
    why.hidden = found.length === 0;
    why.replaceChildren(
      ...found.map((row) => {
        const [name, text] = [...row.cells].map((cell) => cell.textContent);
        const line = document.createElement("p");
        line.append(Object.assign(document.createElement("b"), { textContent: name }), text);
        return line;
      }),
    );
  };
  const cellOf = (target) => {
    const shown = target instanceof Element ? target.closest("[data-cell]") : null;
    return shown === null ? null : shown.dataset.cell;
  };
  const doorwayOf = (target) => {
    const shown = target instanceof Element ? target.closest("[data-ends]") : null;
    return shown === null ? null : shown.dataset.ends;
  };
  document.addEventListener("pointerover", (event) => {
    if (why?.contains(event.target)) return;
    light(cellOf(event.target) ?? doorwayOf(event.target) ?? kept);
  });
  document.addEventListener("click", (event) => {
    const cell = cellOf(event.target);
    if (event.target instanceof HTMLInputElement || event.target instanceof HTMLLabelElement) return;
    if (why?.contains(event.target)) return;
    kept = cell ?? doorwayOf(event.target);
    light(kept);
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
