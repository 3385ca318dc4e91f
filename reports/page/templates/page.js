"use strict";
// The leaderboard: every cell with every metric, filtered, put together and sorted as asked.
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

  // --- numbers ---

  const number = (value) => ({ inf: Infinity, "-inf": -Infinity })[value] ?? value; // null: no value
  const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
  const sorted = (values) => [...values].sort((a, b) => a - b);
  const STATISTICS = {
    mean,
    median: (values) => { const s = sorted(values), n = s.length; return (s[Math.floor((n - 1) / 2)] + s[Math.floor(n / 2)]) / 2; },
    worst: (values, better) => (better === "higher" ? Math.min(...values) : Math.max(...values)),
  };

  // As the tables print it.
  function printed(value, { digits, percent }) {
    if (value === null || Number.isNaN(value)) return "–";
    if (!Number.isFinite(value)) return value > 0 ? "∞" : "−∞";
    const shown = percent ? 100 * value : value;
    if (Math.abs(shown) > 0 && Math.abs(shown) < 0.5 * 10 ** -digits) return `<${(10 ** -digits).toFixed(digits)}`;
    if (Math.abs(shown) >= 1e5) {
      const [mantissa, exponent] = shown.toExponential(1).split("e+");
      return `${mantissa}·10${[...exponent].map((digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit]).join("")}`;
    }
    return shown.toLocaleString("en", { minimumFractionDigits: digits, maximumFractionDigits: digits }).replace("-", "−");
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
      });
    place.replaceChildren(element("p", { className: "all" }, all, " ", none));
    let group;
    for (const { value, text, title, heading, on } of entries) {
      if (heading !== undefined && heading !== group) place.append(element("p", { className: "heading", textContent: heading }));
      group = heading;
      place.append(element("label", { title: title ?? "" }, element("input", { type: "checkbox", name, value, checked: on }), ` ${text}`));
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

  form.one.replaceChildren(...facts.metrics.map(({ title }, at) => element("option", { value: at, textContent: title })));

  // --- tables: heads, and rows of {text, value, mark, title, link} ---

  // The cells of one method (and one model) that are asked for, put together: a mean over the seeds.
  function selection() {
    const { methods, models, cells } = suite();
    const [wantedMethods, wantedModels] = [chosen("method"), chosen("model")];
    const status = form.status.value;
    return {
      methods: methods.map((method, at) => ({ ...method, at })).filter(({ name }) => wantedMethods.has(name)),
      models: models.map((model, at) => ({ ...model, at })).filter(({ name }) => wantedModels.has(name)),
      cells: cells.filter((cell) => wantedMethods.has(methods[cell.method].name) && wantedModels.has(models[cell.model].name)
        && (status === "any" || cell.status === status)),
    };
  }

  const metrics = () => { const wanted = chosen("metric"); return facts.metrics.map((metric, at) => ({ ...metric, at })).filter(({ name }) => wanted.has(name)); };
  const head = (metric) => ({ text: `${metric.title}${metric.percent && !metric.title.endsWith("%") ? " %" : ""}\u00a0${metric.better === "higher" ? "↑" : "↓"}`, title: metric.definition });

  function overSeeds(cells, metric) {
    const values = cells.filter((cell) => cell.status === "ok").map((cell) => number(cell.values[metric.at])).filter((value) => value !== null);
    return values.length ? mean(values) : null;
  }

  // Competition ranks among what is comparable, by what is printed: two firsts have no second.
  function rank(entries, metric) {
    const known = entries.filter(({ value, apart }) => value !== null && Number.isFinite(value) && !apart);
    if (new Set(known.map(({ text }) => text)).size < 2) return; // all are equal
    known.sort((a, b) => (metric.better === "higher" ? b.value - a.value : a.value - b.value));
    let place = 0;
    known.forEach((entry, at) => {
      if (at === 0 || entry.text !== known[at - 1].text) place = at + 1;
      entry.mark = { 1: "best", 2: "second" }[place] ?? "";
    });
  }

  // Whether cells may be ranked by a metric: no broken map ever, a collapsed one by angles alone.
  const mayRank = (cells, metric) => cells.every(({ grade }) => grade !== "broken" && (metric.angles || grade !== "collapsed"));

  function counts(cells) {
    const found = {};
    for (const { status } of cells) found[status] = (found[status] ?? 0) + 1;
    return found;
  }

  function byMethod({ methods, models, cells }) {
    const of = (method, model) => cells.filter((cell) => cell.method === method.at && cell.model === model.at);
    const done = (method, model) => of(method, model).some((cell) => cell.status === "ok");
    const able = methods.filter((method) => models.some((model) => done(method, model)));
    const common = models.filter((model) => able.every((method) => done(method, model)));
    const own = form.over.value === "own";
    const statistic = STATISTICS[form.statistic.value];
    const rows = methods.map((method) => {
      const all = cells.filter((cell) => cell.method === method.at);
      const found = counts(all);
      const bad = Object.entries(found).filter(([status]) => status !== "ok");
      const reasons = all.filter((cell) => cell.status !== "ok").map((cell) => `${suite().models[cell.model].name}: ${cell.status}, ${cell.reason || "no reason given"}`);
      return [
        { text: method.name, title: method.detail, words: true, small: method.atlas ? "many charts, not ranked" : method.detail },
        { text: `${found.ok ?? 0}/${all.length}`, value: all.length ? (found.ok ?? 0) / all.length : null },
        { text: bad.map(([status, count]) => `${count} ${status}`).join(", "), value: all.length - (found.ok ?? 0), title: reasons.join("\n"), mark: bad.length ? "bad" : "", words: true },
        ...metrics().map((metric) => {
          const values = (own ? models : common).map((model) => overSeeds(of(method, model), metric)).filter((value) => value !== null);
          const value = values.length ? statistic(values, metric.better) : null;
          const invalid = all.filter((cell) => !mayRank([cell], metric)).length;
          return { text: printed(value, metric), value, apart: method.atlas || invalid > all.length / 10 };
        }),
      ];
    });
    metrics().forEach((metric, at) => rank(rows.map((row) => row[at + 3]), metric));
    const word = { mean: "Mean", median: "Median", worst: "Worst" }[form.statistic.value];
    said.textContent = own ? `${word} over each method's own models: not the same ones for all.`
      : `${word} over the ${common.length} of ${models.length} models on which all of these methods ended well.`;
    return { heads: [{ text: "Method", words: true }, { text: "ok" }, { text: "not ok", words: true }, ...metrics().map(head)], rows };
  }

  function byModel({ methods, models, cells }) {
    const at = Number(form.one.value);
    const metric = { ...facts.metrics[at], at };
    const rows = models.map((model) => {
      const entries = methods.map((method) => {
        const own = cells.filter((cell) => cell.method === method.at && cell.model === model.at);
        const value = overSeeds(own, metric);
        const bad = own.find((cell) => cell.status !== "ok");
        if (value === null && bad) return { text: bad.status, value: null, title: bad.reason, mark: "bad" };
        const grade = own.map((cell) => cell.grade).find((found) => found === "broken" || found === "collapsed") ?? "";
        return { text: own.length ? printed(value, metric) : "", value, title: grade, apart: method.atlas || !mayRank(own, metric) };
      });
      rank(entries, metric);
      return [{ text: model.name, link: model.page, words: true }, ...entries];
    });
    said.textContent = `${metric.definition}.`;
    return { heads: [{ text: "Model", words: true }, ...methods.map(({ name, detail }) => ({ text: name, title: detail }))], rows };
  }

  function byCell({ cells }) {
    const { methods, models } = suite();
    said.textContent = `${cells.length} of ${suite().cells.length} cells.`;
    return {
      heads: [{ text: "Model", words: true }, { text: "Method", words: true }, { text: "seed" }, { text: "status", words: true }, ...metrics().map(head)],
      rows: cells.map((cell) => [
        { text: models[cell.model].name, link: models[cell.model].page, words: true },
        { text: methods[cell.method].name, title: methods[cell.method].detail, words: true },
        { text: String(cell.seed), value: cell.seed },
        { text: cell.status, title: cell.reason, mark: cell.status === "ok" ? "" : "bad", small: cell.status === "ok" ? "" : cell.reason, words: true },
        ...metrics().map((metric) => { const value = number(cell.values[metric.at]); return { text: printed(value, metric), value }; }),
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
      const value = number(dataset.value);
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
  form.addEventListener("submit", (event) => event.preventDefault());
  form.addEventListener("change", (event) => { if (event.target === form.suite) offer(); show(); });
  offer();
  show();
})();
