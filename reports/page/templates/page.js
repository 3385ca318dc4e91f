"use strict";
// The leaderboard: what the report has printed and ranked, picked and sorted as asked.
(() => {
  const facts = JSON.parse(document.getElementById("cells").textContent);
  const board = document.getElementById("board");
  const form = document.getElementById("filters");
  const said = document.getElementById("board-says");

  function element(name, properties = {}, ...children) {
    const made = document.createElement(name);
    Object.assign(made, properties);
    made.append(...children);
    return made;
  }

  // --- what is asked for ---

  const suite = () => facts.suites.find((one) => one.name === form.suite.value);
  const chosen = (name) => new Set([...form.querySelectorAll(`input[name=${name}]:checked`)].map((box) => box.value));

  function checks(name, entries) {
    const place = document.getElementById(`choose-${name}`);
    const all = element("button", { type: "button", textContent: "all" });
    const none = element("button", { type: "button", textContent: "none" });
    for (const [button, state] of [[all, true], [none, false]])
      button.addEventListener("click", () => {
        for (const box of place.querySelectorAll("input")) box.checked = state;
        show();
        keep();
      });
    place.replaceChildren(element("p", { className: "all" }, all, " ", none));
    let group;
    for (const { value, text, title, heading, on } of entries) {
      if (heading !== undefined && heading !== group) place.append(element("p", { className: "heading", textContent: heading }));
      group = heading;
      place.append(element("label", { title: title ?? "" }, element("input", { type: "checkbox", name, value, defaultChecked: on }), ` ${text}`));
    }
  }

  function offer() {
    checks("method", suite().methods.map(({ name, detail }) => ({ value: name, text: name, title: detail, on: true })));
    checks("model", suite().models.map(({ name }) => ({ value: name, text: name, on: true })));
    const states = [...new Set(suite().cells.map((cell) => cell.status))];
    form.status.replaceChildren(...["any", ...states].map((state) => element("option", { value: state, textContent: state })));
  }

  checks("metric", facts.metrics.map(({ name, title, group, definition }) =>
    ({ value: name, text: title, title: definition, heading: group, on: facts.shown.includes(name) })));

  // What pairs may be compared by: what counts as a rule, and each criterion alone.
  const weights = { [facts.counted.join(" and ")]: facts.counted, ...Object.fromEntries(facts.criteria.map((name) => [name, [name]])), all: facts.criteria };
  form.weights.replaceChildren(...Object.keys(weights).map((name) => element("option", { value: name, textContent: name })));

  form.one.replaceChildren(...facts.metrics.map(({ name, title }) => element("option", { value: name, textContent: title })));

  // --- tables: heads, and rows of {text, value, mark, title, link} ---

  // The methods, models and cells that are asked for, each with its place in the suite.
  function selection() {
    const { methods, models, cells } = suite();
    const [wantedMethods, wantedModels] = [chosen("method"), chosen("model")];
    const status = form.status.value;
    return {
      methods: methods.map((method, at) => ({ ...method, at })).filter((method) => wantedMethods.has(method.name) && fits(method)),
      models: models.filter(({ name }) => wantedModels.has(name)),
      cells: cells.filter((cell) => wantedMethods.has(methods[cell.method].name) && fits(methods[cell.method])
        && wantedModels.has(models[cell.model].name) && (status === "any" || cell.status === status) && inTime(cell)),
    };
  }

  // Whether a method is of the kind that is asked for, and a cell took no longer than it may.
  const fits = ({ input, charts }) => [[form.input.value, input], [form.charts.value, charts]].every(([asked, own]) => asked === "any" || asked === own);
  const seconds = facts.metrics.findIndex(({ name }) => name === "seconds");
  const inTime = (cell) => form.budget.value === "any" || !(cell.entries[seconds][1] > Number(form.budget.value));

  // The share of pairs that each method wins on the chosen models, with half of its 95 % interval:
  // among the chosen methods with one chart, or among those with many.
  function shares(methods, models) {
    const { won, methods: every, models: all } = suite();
    const counted = weights[form.weights.value];
    const places = models.map(({ name }) => all.findIndex((model) => model.name === name));
    const has = (c, at) => { const map = all[c].maps[at]; return Boolean(map) && map.status === "ok" && inTime(map); };
    return new Map(methods.map((one) => {
      const rivals = methods.filter((other) => other.at !== one.at && other.charts === one.charts);
      if (!rivals.length || !places.length) return [one.at, null];
      const means = places.map((c) => rivals.reduce((sum, other) => {
        const [here, there] = [has(c, one.at), has(c, other.at)];
        if (!here || !there) return sum + (here === there ? 0.5 : Number(here));
        const halves = counted.reduce((total, name) => total + Number(won[name][c][one.at * every.length + other.at]), 0);
        return sum + halves / counted.length / 2;
      }, 0) / rivals.length);
      const mean = means.reduce((sum, value) => sum + value, 0) / means.length;
      const spread = Math.sqrt(means.reduce((sum, value) => sum + (value - mean) ** 2, 0) / (means.length - 1) / means.length);
      return [one.at, { mean, half: means.length > 1 ? Math.min(spread * facts.quantiles[means.length], 1) : null }];
    }));
  }

  const metrics = () => { const wanted = chosen("metric"); return facts.metrics.map((metric, at) => ({ ...metric, at })).filter(({ name }) => wanted.has(name)); };
  const heading = ({ head, definition }) => ({ text: head, title: definition });
  const ranked = ([text, value, mark]) => ({ text, value, mark });

  function byMethod({ methods, models }) {
    const over = form.over.value;
    const all = suite().summaries[form.statistic.value][over];
    const won = shares(methods, models);
    const share = (method) => {
      const found = won.get(method.at);
      if (!found) return { text: "–", value: null };
      return { text: `${(100 * found.mean).toFixed(1)} %`, value: found.mean, small: found.half === null ? "" : `± ${(100 * found.half).toFixed(1)}` };
    };
    const order = [...methods].sort((a, b) => (a.charts === "many") - (b.charts === "many") || (won.get(b.at)?.mean ?? -1) - (won.get(a.at)?.mean ?? -1));
    const hasBad = methods.some(({ bad }) => bad);
    const rows = order.map((method) => [
      { text: method.name, title: method.detail, words: true, small: method.detail },
      share(method),
      { text: method.ok, value: method.share },
      ...(hasBad ? [{ text: method.bad, title: method.reasons, mark: method.bad ? "bad" : "", words: true }] : []),
      ...metrics().map((metric) => ranked(all[method.at][metric.at])),
    ]);
    const word = { mean: "Mean", median: "Median", worst: "Worst" }[form.statistic.value];
    said.textContent = over === "own" ? `${word} over each method's own models: not the same ones for all.`
      : `${word} over the ${suite().common} of ${suite().models.length} models on which all methods gave a map and the metric is defined.`;
    return { heads: [{ text: "Method", words: true }, { text: "pairs won", title: "share of the pairs with other methods shown that are won, by " + form.weights.value + ", validity first" }, { text: "ok" }, ...(hasBad ? [{ text: "not ok", words: true }] : []), ...metrics().map(heading)], rows };
  }

  function byModel({ methods, models }) {
    const at = facts.metrics.findIndex(({ name }) => name === form.one.value);
    const rows = models.map(({ name, page, maps }) => [
      { text: name, link: page, words: true },
      ...methods.map((method) => {
        const map = maps[method.at];
        if (!map) return { text: "", value: null };
        if (!inTime(map)) return { text: "too slow", value: null, mark: "bad" };
        if (map.status !== "ok") return { text: map.status, value: null, title: map.reason, mark: "bad" };
        return { ...ranked(map.entries[at]), title: map.grade };
      }),
    ]);
    said.textContent = `${facts.metrics[at].definition}.`;
    return { heads: [{ text: "Model", words: true }, ...methods.map(({ name, detail }) => ({ text: name, title: detail }))], rows };
  }

  function byCell({ cells }) {
    const { methods, models } = suite();
    said.textContent = `${cells.length} of ${suite().cells.length} cells.`;
    return {
      heads: [{ text: "Model", words: true }, { text: "Method", words: true }, { text: "seed" }, { text: "status", words: true }, ...metrics().map(heading)],
      rows: cells.map((cell) => [
        { text: models[cell.model].name, link: models[cell.model].page, words: true },
        { text: methods[cell.method].name, title: methods[cell.method].detail, words: true },
        { text: String(cell.seed), value: cell.seed },
        { text: cell.status, title: cell.reason, mark: cell.status === "ok" ? "" : "bad", small: cell.status === "ok" ? "" : cell.reason, words: true },
        ...metrics().map((metric) => ranked(cell.entries[metric.at])),
      ]),
    };
  }

  function entry({ text, title, mark, link, small, words, value }) {
    const made = element("td", { className: `${words ? "text" : ""} ${mark ?? ""}`.trim(), title: title ?? "" });
    if (!words) made.dataset.value = value ?? "";
    made.append(link ? element("a", { href: link, textContent: text }) : text);
    if (small) made.append(element("small", { textContent: small }));
    return made;
  }

  function show() {
    const { heads, rows } = { method: byMethod, model: byModel, cell: byCell }[form.view.value](selection());
    form.dataset.view = form.view.value;
    const top = element("tr", {}, ...heads.map(({ text, title, words }) => {
      const made = element("th", { scope: "col", className: words ? "text" : "", title: title ?? "" }, element("button", { type: "button", textContent: text }));
      made.setAttribute("aria-sort", "none");
      return made;
    }));
    const body = element("tbody", {}, ...rows.map((row) => element("tr", {}, ...row.map(entry))));
    board.replaceChildren(element("thead", {}, top), body);
    sortable(board);
  }

  // --- sorting: every table, within each of its blocks; what has no number goes last, whichever way ---

  function sortable(table) {
    for (const cell of table.querySelectorAll("th[aria-sort]"))
      cell.querySelector("button").addEventListener("click", () => sort(table, cell));
  }

  function sort(table, cell) {
    const way = cell.getAttribute("aria-sort") === "ascending" ? -1 : 1;
    for (const other of cell.parentElement.cells) other.setAttribute("aria-sort", "none");
    cell.setAttribute("aria-sort", way === 1 ? "ascending" : "descending");
    const text = cell.classList.contains("text");
    const value = (row) => {
      const { dataset, textContent } = row.cells[cell.cellIndex];
      if (text) return textContent.toLowerCase();
      const value = { inf: Infinity, "-inf": -Infinity }[dataset.value] ?? dataset.value;
      return value === undefined || value === "" ? NaN : Number(value);
    };
    const compare = (one, two) => {
      const [a, b] = [value(one), value(two)];
      if (Number.isNaN(a) || Number.isNaN(b)) return Number.isNaN(a) - Number.isNaN(b);
      return a < b ? -way : a > b ? way : 0;
    };
    for (const body of table.tBodies) body.append(...[...body.rows].sort(compare));
  }

  for (const table of document.querySelectorAll("table")) sortable(table);
  form.addEventListener("keydown", (event) => {
    if (event.key === "Escape") for (const open of form.querySelectorAll("details[open]")) open.open = false;
  });
  // --- the address keeps the choice: what is not as it is at first, after the # ---

  const selects = [...form.querySelectorAll("select")].filter(({ name }) => name !== "suite");
  const boxes = (name) => [...form.querySelectorAll(`input[name=${name}]`)];
  const kinds = ["method", "model", "metric"];

  function keep() {
    const kept = new URLSearchParams();
    if (form.suite.selectedIndex) kept.set("suite", form.suite.value);
    for (const { name, selectedIndex, value } of selects) if (selectedIndex) kept.set(name, value);
    for (const name of kinds) {
      const changed = boxes(name).filter((box) => box.checked !== box.defaultChecked).map(({ value }) => value);
      for (const value of changed) kept.append(name, value);
    }
    const text = kept.toString();
    if (text || location.hash.includes("=")) history.replaceState(null, "", `#${text}`);
  }

  function recall() {
    const kept = new URLSearchParams(location.hash.includes("=") ? location.hash.slice(1) : "");
    const take = (select) => {
      const index = [...select.options].findIndex(({ value }) => value === kept.get(select.name));
      select.selectedIndex = Math.max(index, 0);
    };
    take(form.suite);
    offer();
    selects.forEach(take);
    for (const name of kinds) {
      const changed = new Set(kept.getAll(name));
      for (const box of boxes(name)) box.checked = box.defaultChecked !== changed.has(box.value);
    }
    show();
  }

  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("change", (event) => { if (event.target === form.suite) offer(); show(); keep(); });
  addEventListener("hashchange", () => { if (location.hash.includes("=")) recall(); });
  recall();
})();
