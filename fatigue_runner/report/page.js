// Tables that can be sorted, filtered and saved; without a script the page is the same, but for these.
"use strict";
for (const table of document.querySelectorAll("table[data-name]")) {
  const body = table.tBodies[0], heads = [...table.tHead.rows[0].cells];
  if (body.rows.length < 2) continue;
  const tools = document.createElement("div");
  tools.className = "tools";
  const words = (cell) => cell.textContent.trim();
  const name = (head) => [head.querySelector("span"), head.querySelector("small")].filter(Boolean).map(words).join(", ");

  // 1,234.5, −2.0 % and 1.6e−3 are numbers; a dash is none and stays last
  const value = (cell) => {
    const found = words(cell).replace(/[\u2212]/g, "-").replace(/[,\s\u00a0\u202f]/g, "").match(/^-?\d*\.?\d+(e-?\d+)?/i);
    return found ? Number(found[0]) : NaN;
  };
  heads.forEach((head, at) => {
    const button = document.createElement("button");
    button.type = "button";
    button.title = "Sort by this column";
    button.append(...head.childNodes);
    head.append(button);
    head.setAttribute("aria-sort", "none");
    button.addEventListener("click", () => {
      const up = head.getAttribute("aria-sort") !== "ascending";
      heads.forEach((other) => other.setAttribute("aria-sort", "none"));
      head.setAttribute("aria-sort", up ? "ascending" : "descending");
      const numbers = head.classList.contains("number");
      const rows = [...body.rows].map((row) => [numbers ? value(row.cells[at]) : words(row.cells[at]), row]);
      rows.sort(([a], [b]) => {
        if (!numbers) return (up ? 1 : -1) * a.localeCompare(b, "en", { numeric: true });
        if (isNaN(a) || isNaN(b)) return isNaN(a) - isNaN(b);
        return up ? a - b : b - a;
      });
      body.append(...rows.map(([, row]) => row));
      body.append(...[...body.rows].filter((row) => words(row.cells[0]) === "sum"));
    });
  });

  const picks = [];
  const filter = () => {
    for (const row of body.rows)
      row.classList.toggle("out", picks.some(([at, select]) => select.value && words(row.cells[at]) !== select.value));
  };
  heads.forEach((head, at) => {
    const values = [...new Set([...body.rows].map((row) => words(row.cells[at])))];
    if (!head.hasAttribute("data-pick") || values.length < 2) return;
    const label = document.createElement("label"), select = document.createElement("select");
    select.append(new Option("all", ""), ...values.map((text) => new Option(text, text)));
    select.addEventListener("change", filter);
    label.append(`${words(head.querySelector("span"))} `, select);
    tools.append(label);
    picks.push([at, select]);
  });

  const save = document.createElement("button");
  save.type = "button";
  save.textContent = "CSV";
  save.title = "Save this table as a file that spreadsheets open";
  save.addEventListener("click", () => {
    const quoted = (text) => (/[",\n]/.test(text) ? `"${text.replace(/"/g, '""')}"` : text);
    const cell = (text, number) => quoted(number ? text.replace(/\u2212/g, "-").replace(/(\d),(?=\d{3})/g, "$1") : text);
    const lines = [heads.map((head) => quoted(name(head))).join(",")];
    for (const row of body.rows)
      if (!row.classList.contains("out"))
        lines.push([...row.cells].map((c, at) => cell(words(c), heads[at].classList.contains("number"))).join(","));
    const link = document.createElement("a");
    // the mark tells a spreadsheet that the text is UTF-8
    link.href = URL.createObjectURL(new Blob(["\ufeff" + lines.join("\n") + "\n"], { type: "text/csv" }));
    link.download = `${table.dataset.name}.csv`;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  });
  tools.append(save);
  table.parentElement.before(tools);
}
