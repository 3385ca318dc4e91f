"use strict";
// Sorts the rows of a table within each of its blocks by the column whose head is pressed.
// Cells without a number go last, whichever way.
for (const head of document.querySelectorAll("th[aria-sort]")) {
  head.querySelector("button").addEventListener("click", () => {
    const column = head.cellIndex;
    const way = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
    for (const other of head.parentElement.cells) other.setAttribute("aria-sort", "none");
    head.setAttribute("aria-sort", way === 1 ? "ascending" : "descending");
    const text = head.classList.contains("text");
    const value = (row) => {
      const raw = row.cells[column].dataset.value;
      if (text) return raw.toLowerCase();
      const infinite = { inf: Infinity, "-inf": -Infinity };
      return raw in infinite ? infinite[raw] : raw === "" ? NaN : Number(raw);
    };
    const compare = (one, two) => {
      const [a, b] = [value(one), value(two)];
      if (Number.isNaN(a) || Number.isNaN(b)) return Number.isNaN(a) - Number.isNaN(b);
      return a < b ? -way : a > b ? way : 0;
    };
    for (const body of head.closest("table").tBodies) body.append(...[...body.rows].sort(compare));
  });
}
